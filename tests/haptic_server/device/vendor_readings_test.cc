// Drivers on fakes of the vendors' libraries, written from the vendors' texts alone: whichever way
// a doubtful sentence is read, a session has its device and its force.
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <dlfcn.h>

#include "hlm/device/force_dimension_device.h"
#include "hlm/device/open_haptics_device.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;   // s
constexpr double kForce = 1;   // N
constexpr int kSession = 150;  // Ticks.

/// What a fake has besides the vendor's functions.
class Fake {
 public:
  explicit Fake(const char* file) : library_(dlopen(file, RTLD_NOW | RTLD_LOCAL)) {
    INFO(dlerror());
    REQUIRE(library_ != nullptr);
  }
  template <class Function>
  Function* function(const char* name) const {
    void* const found = dlsym(library_, name);
    REQUIRE(found != nullptr);
    return reinterpret_cast<Function*>(found);
  }
  /// Each doubtful sentence in each reading, and all in the second one.
  std::vector<std::string> readings() const {
    std::vector<std::string> all{"first", "second"};
    const auto doubt = function<const char*(int)>("fake_doubt");
    for (int i = 0; const char* const text = doubt(i); ++i) {
      const std::string sentence = text;
      const std::size_t colon = sentence.find(':');
      const std::size_t bar = sentence.find('|');
      all.push_back(sentence.substr(0, colon + 1) + sentence.substr(bar + 1));
    }
    return all;
  }

 private:
  void* library_;
};

/// A session: the handle is pushed, and each tick has a state. pass: lets time go on by 1 ms.
template <class AnyDevice, class Pass>
int good_ticks(AnyDevice& device, Pass&& pass) {
  device.align(Pose{});
  device.enable();
  Wrench F = Wrench::Zero();
  F[1] = kForce;
  int good = 0;
  for (int i = 0; i < kSession; ++i) {
    const auto state = device.read();
    good += state && state->health != DeviceHealth::kForceOff && device.write(F) ? 1 : 0;
    pass();
  }
  return good;
}

TEST_CASE("No reading of Force Dimension's texts stops a session, and the motors give its force") {
  for (const char* file : {HLM_FAKE_DRD, HLM_FAKE_DHD}) {
    const Fake fake(file);
    const auto configure = fake.function<bool(const char*, const char*)>("fake_configure");
    const auto truth =
        fake.function<void(double*, double*, double*, double*, double*)>("fake_truth");
    const auto advance = fake.function<void(double)>("fake_advance");
    for (const char* model : {"omega.3", "omega.7", "sigma.7"}) {
      for (const std::string& reading : fake.readings()) {
        CAPTURE(file, model, reading);
        REQUIRE(configure(model, reading.c_str()));
        advance(0);  // From now on the clock is the test's.
        ForceDimensionDevice device(std::make_shared<const ForceDimensionLibrary>(file), {}, kDt);
        CHECK_NOTHROW(device.calibrate());
        // Its watchdog must not bite when the machine stalls.
        const int good = good_ticks(device, [&] {
          advance(kDt);
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        });
        INFO(device.cause());
        CHECK(good == kSession);
        double p[3], v[3], F[3], opening, grip;
        truth(p, v, F, &opening, &grip);
        CHECK(F[1] == Approx(kForce));  // N
        device.disable();
      }
    }
  }
}

TEST_CASE("No reading of OpenHaptics' texts stops a session, and the motors give its force") {
  const Fake fake(HLM_FAKE_HD);
  const auto configure = fake.function<bool(const char*)>("fake_configure");
  const auto truth = fake.function<void(double*, double*, double*)>("fake_truth");
  for (const std::string& reading : fake.readings()) {
    CAPTURE(reading);
    REQUIRE(configure(reading.c_str()));
    OpenHapticsDevice device(std::make_shared<const OpenHapticsLibrary>(HLM_FAKE_HD),
                             {.oldest = 0.1});  // s; the machine may stall.
    CHECK_NOTHROW(device.calibrate());
    const int good =
        good_ticks(device, [] { std::this_thread::sleep_for(std::chrono::milliseconds(1)); });
    INFO(device.cause());
    CHECK(good == kSession);
    double p[3], v[3], F[3];
    truth(p, v, F);
    CHECK(F[1] > 0.5 * kForce);  // N; a library may ramp it up.
    device.disable();
  }
}

}  // namespace
}  // namespace hlm::server
