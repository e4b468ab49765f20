// Drivers on fakes of the vendors' libraries, written from the vendors' texts alone: whichever way
// a doubtful sentence is read, a session has its device and its force.
#include <algorithm>
#include <chrono>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <dlfcn.h>

#include "hlm/devices/force_dimension_device.h"
#include "hlm/devices/open_haptics_device.h"
#include "hlm/haptic_server/device/device_driver.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"

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

std::unique_ptr<DeviceDriver> haply_driver() {
  auto drivers = registered_drivers();
  const auto haply =
      std::ranges::find_if(drivers, [](const auto& driver) { return driver->name() == "haply"; });
  REQUIRE(haply != drivers.end());
  return std::move(*haply);
}

/// The fake of Haply's service with these arguments, and the driver on it.
class HaplySession {
 public:
  explicit HaplySession(const std::vector<std::string>& arguments)
      : service_(command(arguments)), driver_(haply_driver()) {
    REQUIRE(
        test::wait_until(20, [&] { return service_.output().find('\n') != std::string::npos; }));
    std::istringstream line(service_.output());
    std::string ready, port, events;
    line >> ready >> port >> events;
    set("address", "localhost:" + port);
    set("events", events);
    set("oldest", "0.1");  // s; the machine may stall.
  }
  std::unique_ptr<Device> open() const { return driver_->open(kDt); }

 private:
  static std::vector<std::string> command(const std::vector<std::string>& arguments) {
    std::vector<std::string> all{"/usr/bin/python3", HLM_FAKE_HAPLY, "--port=0", "--events-port=0",
                                 "--http-port=0"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return all;
  }
  void set(const std::string& key, const std::string& value) {
    const auto* const setting = driver_->table().find(key);
    REQUIRE(setting != nullptr);
    REQUIRE_FALSE(setting->set(key, {value}));
  }

  test::Process service_;
  std::unique_ptr<DeviceDriver> driver_;
};

/// Versions, grips, and the second reading of each doubtful sentence. Zeros that are left out are
/// not told from values that did not change: both together are no protocol.
std::vector<std::vector<std::string>> haply_services() {
  const std::string second = "--reading=second,zeros:sent";
  std::vector<std::vector<std::string>> all{
      {second},
      {"--version=3.1"},
      {"--version=3.1", second + ",inventory:complete"},
      {"--version=3.0", second + ",inventory:complete"},
  };
  for (const char* grip : {"list", "wired", "custom", "none"})
    all.push_back({std::string("--grip=") + grip});
  std::istringstream doubts(test::run({"/usr/bin/python3", HLM_FAKE_HAPLY, "--doubts"}).output);
  for (std::string line; std::getline(doubts, line);) {
    const std::size_t colon = line.find(':');
    if (line[0] == ' ' || colon == std::string::npos) continue;
    all.push_back({"--reading=" + line.substr(0, colon + 1) + line.substr(line.find('|') + 1)});
  }
  return all;
}

TEST_CASE("No reading of Haply's texts stops a session, and the motors give its force") {
  const auto services = haply_services();
  REQUIRE(services.size() > 20);
  for (const std::vector<std::string>& arguments : services) {
    CAPTURE(arguments);
    const HaplySession session(arguments);
    const std::unique_ptr<Device> device = session.open();
    CHECK_NOTHROW(device->calibrate());
    const int good =
        good_ticks(*device, [] { std::this_thread::sleep_for(std::chrono::milliseconds(1)); });
    INFO(device->cause());
    CHECK(good == kSession);
    const auto state = device->read();
    REQUIRE(state);
    CHECK(state->X_WD.p.y() > 1e-3);  // m; a hand of 300 N/m gives way.
    device->disable();
  }
}

}  // namespace
}  // namespace hlm::server
