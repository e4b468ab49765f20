// The core of the stand-ins: it keeps real time, obeys orders, and shows what its motors give.
#include "hlm/devices/stand_ins/stand_in.h"

#include <cstdlib>
#include <fstream>

#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::stand_in {
namespace {

using namespace std::chrono_literals;

/// A stand-in with files of its own.
struct Bench {
  explicit Bench(const std::string& hand =
                     "[[segment]]\nduration = 60.0\n"
                     "wrench = { force = [0, 1, 0] }\n") {
    std::ofstream(directory.file("hand.toml")) << hand;
    std::ofstream(directory.file("orders"));
    setenv("HAPTIC_STAND_IN_HAND", directory.file("hand.toml").c_str(), 1);
    setenv("HAPTIC_STAND_IN_ORDERS", directory.file("orders").c_str(), 1);
    setenv("HAPTIC_STAND_IN_MOTORS", directory.file("motors").c_str(), 1);
    stand_in.emplace(server::SimulatedDeviceOptions{});
  }

  void order(const std::string& line) const {
    std::ofstream(directory.file("orders"), std::ios::app) << line << '\n';
  }
  /// N, along y, as another process sees it.
  double motor() const {
    std::array<double, 6> F{};
    std::ifstream(directory.file("motors"), std::ios::binary)
        .read(reinterpret_cast<char*>(F.data()), sizeof F);
    return F[1];
  }
  void push(double force) {
    Wrench F = Wrench::Zero();
    F[1] = force;
    stand_in->command(F);
  }
  bool waits_for(const std::function<bool()>& condition) const {
    return test::wait_until(5, condition);
  }

  test::TemporaryDirectory directory;
  std::optional<StandIn> stand_in;
};

TEST_CASE("Nobody asks, and its clock goes on: 1 N drifts 1 kg with 5 N·s/m to 0.16 m/s") {
  Bench bench;
  bench.stand_in->enable();
  std::this_thread::sleep_for(1200ms);
  const server::DeviceState state = bench.stand_in->state();
  CHECK(state.V_WD[1] == Approx(0.16).epsilon(0.02));  // m/s: (1 - 0.2) N
}

TEST_CASE("Motors give what is commanded, until the watchdog, an order or disable() ends it") {
  Bench bench;
  bench.push(3);
  CHECK(bench.motor() == 0);
  bench.stand_in->enable();
  bench.push(3);
  CHECK(bench.waits_for([&] { return bench.motor() == 3; }));
  SECTION("disabled") { bench.stand_in->disable(); }
  SECTION("unplugged") { bench.order("unplug"); }
  SECTION("forced off") { bench.order("force_off"); }
  SECTION("watchdog") {
    bench.stand_in->set_watchdog(0.02);
    CHECK(bench.waits_for([&] { return bench.stand_in->watchdog_has_bitten(); }));
  }
  CHECK(bench.waits_for([&] { return bench.motor() == 0; }));
  bench.push(3);
  std::this_thread::sleep_for(5ms);
  CHECK(bench.motor() == 0);
  CHECK_FALSE(bench.stand_in->enabled());
  bench.order("good");
  CHECK(bench.waits_for([&] {
    bench.stand_in->enable();
    bench.push(2);
    return bench.motor() == 2;
  }));
}

TEST_CASE("States freeze, are late and are slow on order, and buttons are pressed") {
  Bench bench;
  bench.stand_in->enable();
  std::this_thread::sleep_for(600ms);
  const auto after = [&](const char* order, StandInFault fault) {
    bench.order(order);
    CHECK(bench.waits_for([&] { return bench.stand_in->has(fault); }));
    return bench.stand_in->state();
  };
  const server::DeviceState late = after("late", StandInFault::kLate);
  CHECK(late.V_WD[1] > 0.1);  // m/s
  bench.order("good");
  CHECK(bench.waits_for([&] { return !bench.stand_in->has(StandInFault::kLate); }));
  CHECK(bench.stand_in->state().X_WD.p.y() - late.X_WD.p.y() > 0.03 * late.V_WD[1]);
  bench.order("press 1");
  CHECK(bench.waits_for([&] { return bench.stand_in->state().buttons == 0b10; }));
  const server::DeviceState frozen = after("freeze", StandInFault::kFreeze);
  std::this_thread::sleep_for(20ms);
  CHECK(bench.stand_in->state().X_WD == frozen.X_WD);
  bench.order("good\nrelease 1\nslow");
  CHECK(bench.waits_for([&] { return bench.stand_in->has(StandInFault::kSlow); }));
  CHECK(bench.stand_in->state().buttons == 0);
  int changes = 0;
  double y = 0;
  const auto end = std::chrono::steady_clock::now() + 200ms;
  while (std::chrono::steady_clock::now() < end) {
    const double now = bench.stand_in->state().X_WD.p.y();
    if (std::exchange(y, now) != now) ++changes;
    std::this_thread::sleep_for(500us);
  }
  CHECK(changes <= 42);  // 200 Hz for 0.2 s
}

}  // namespace
}  // namespace hlm::stand_in
