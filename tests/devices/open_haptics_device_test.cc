// Devices of OpenHaptics, through the stand-in for the vendor's library.
#include "hlm/devices/open_haptics_device.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/system/process.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using namespace std::chrono_literals;

std::unique_ptr<OpenHapticsDevice> opened(const OpenHapticsOptions& options = {}) {
  auto device = std::make_unique<OpenHapticsDevice>(
      std::make_shared<const OpenHapticsLibrary>(HLM_STAND_IN), options);
  device->calibrate();
  return device;
}

Wrench push(double force) {
  Wrench F = Wrench::Zero();
  F[1] = force;
  return F;
}

/// Of all cases: the library stays open.
struct StandInFiles {
  StandInFiles() {
    setenv("HAPTIC_STAND_IN_MOTORS", motors.c_str(), 1);
    std::ofstream{orders};
    setenv("HAPTIC_STAND_IN_ORDERS", orders.c_str(), 1);
  }
  const test::TemporaryDirectory directory;
  const std::string motors = directory.file("motors");
  const std::string orders = directory.file("orders");
};
const StandInFiles stand_in;

void order(const std::string& what) {
  std::ofstream(stand_in.orders, std::ios::app) << what << '\n';
}

/// What the motors give along y, N.
double motor(const std::string& file) {
  std::array<double, 6> F{};
  std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(F.data()), sizeof F);
  return F[1];
}

TEST_CASE(
    "Of a command that is not renewed nothing is left when it is old, and a tick allocates "
    "nothing") {
  const std::string& motors = stand_in.motors;
  const auto device = opened({.oldest = 0.1});                // s; the machine may stall.
  CHECK(device->ratings().max_force == Approx(3.3));          // N
  CHECK(device->ratings().continuous_force == Approx(0.88));  // N
  CHECK(device->ratings().mass == Approx(0.1));               // kg
  CHECK(device->ratings().max_stiffness == Approx(2000));     // N/m
  CHECK(device->ratings().max_torque == 0);
  CHECK(device->ratings().exchange_rate == 1000);  // Hz
  bool works = true;
  std::size_t allocations = 0;
  {
    const test::NoMalloc guard;
    device->align(Pose{});
    device->enable();
    for (int i = 0; i < 100; ++i) {
      works &= device->read() && device->write(push(1));
      std::this_thread::sleep_for(1ms);
    }
    allocations = guard.allocations();
  }
  INFO(device->cause());
  CHECK(works);
  CHECK(allocations == 0);
  CHECK(motor(motors) == 1);
  std::this_thread::sleep_for(200ms);  // The servo stands still.
  CHECK(motor(motors) == 0);
  device->write(push(1));
  CHECK(test::wait_until(1, [&] { return motor(motors) == 1; }));
  device->disable();
  CHECK(test::wait_until(1, [&] { return motor(motors) == 0; }));
}

TEST_CASE("A device that the vendor's setup does not know is named with its library") {
  CHECK_THROWS_WITH(
      opened({.unit = "left"}),
      ContainsSubstring("the device 'left' cannot be opened") && ContainsSubstring(HLM_STAND_IN));
}

TEST_CASE(
    "A device has the name of current drivers or of older ones, and none is named with both") {
  CHECK(opened()->unit() == "Default Device");
  setenv("HAPTIC_STAND_IN_UNIT", "Default PHANToM", 1);
  CHECK(opened()->unit() == "Default PHANToM");
  setenv("HAPTIC_STAND_IN_UNIT", "right", 1);
  CHECK_THROWS_WITH(opened(), ContainsSubstring("'Default Device' or 'Default PHANToM'") &&
                                  ContainsSubstring("the key unit"));
  CHECK(opened({.unit = "right"})->unit() == "right");
  unsetenv("HAPTIC_STAND_IN_UNIT");
}

TEST_CASE("A calibration is updated before force, and one that needs a person is named") {
  setenv("HAPTIC_STAND_IN_STATE", "inkwell", 1);
  CHECK_THROWS_WITH(opened(),
                    ContainsSubstring("is not calibrated: put its stylus into the inkwell"));
  setenv("HAPTIC_STAND_IN_STATE", "needs_update", 1);
  CHECK_NOTHROW(opened());
  unsetenv("HAPTIC_STAND_IN_STATE");
}

TEST_CASE("A handle that a stop holds is no fault, though the library's speed lags by 8 ms") {
  const auto device = opened({.oldest = 0.1});  // s; the machine may stall.
  device->enable();
  const auto works = [&] { return device->read() && device->write(push(0)); };
  for (int i = 0; i < 5; ++i) {
    order("hold 0 0 0");
    REQUIRE(test::wait_until(
        3, [&] { return works() && std::abs(device->read()->X_WD.p.y()) < 1e-3; }));
    order("hold 0 0.1 0");
    REQUIRE(test::wait_until(3, [&] { return works() && device->read()->V_WD[1] > 0.05; }));
    order("stop");
    bool all = true;
    for (int k = 0; k < 200; ++k) {
      all = all && works();
      std::this_thread::sleep_for(1ms);
    }
    INFO(device->cause());
    CHECK(all);
    order("good\nlet_go");
    std::this_thread::sleep_for(30ms);  // Where it went meanwhile is not known.
  }
}

TEST_CASE("The first frames of a scheduler are no faults, and no pose of the device") {
  const Vector3 none(0, -0.110, -0.035);  // m: the library's default.
  for (int i = 0; i < 3; ++i) {
    const auto device = opened({.oldest = 0.1});  // s; the machine may stall.
    device->enable();
    const auto state = device->read();
    INFO(device->cause());
    REQUIRE(state);
    CHECK((state->X_WD.p - none).norm() > 0.01);
    CHECK_FALSE(state->warm);
  }
}

TEST_CASE("Motors that get warm are told, and are no fault") {
  setenv("HAPTIC_STAND_IN_STATE", "warm", 1);
  const auto device = opened({.oldest = 0.1});  // s; the machine may stall.
  device->enable();
  CHECK(test::wait_until(1, [&] {
    const auto state = device->read();
    return state && state->warm;
  }));
  CHECK(cause_of_error(0x0200) == nullptr);
  CHECK(says_warm(0x0200));
  unsetenv("HAPTIC_STAND_IN_STATE");
}

TEST_CASE("A scheduler whose rate cannot be set runs at its own") {
  const auto device = opened({.rate = 900, .oldest = 0.1});  // Hz; not 500, 1000 or 2000.
  device->enable();
  CHECK(device->read());
}

TEST_CASE(
    "An error that the library reports once, between two reads, is a failure until enable()") {
  const auto device = opened({.oldest = 0.1});  // s; the machine may stall.
  device->enable();
  REQUIRE(
      test::wait_until(1, [&] { return device->write(push(1)) && motor(stand_in.motors) == 1; }));
  order("error\nforce_off");
  CHECK(test::wait_until(1, [&] { return motor(stand_in.motors) == 0; }));
  std::this_thread::sleep_for(20ms);  // Some periods of the scheduler.
  order("good");
  std::this_thread::sleep_for(50ms);
  CHECK_FALSE(device->read());
  CHECK_THAT(device->cause(), ContainsSubstring("a fault of its own"));
  device->disable();
  CHECK(test::wait_until(2, [&] {
    device->enable();
    return device->read().has_value();
  }));
}

TEST_CASE("What the library calls an error has words, what is none has not") {
  CHECK(cause_of_error(0) == nullptr);
  CHECK(cause_of_error(0x0201) == nullptr);
  CHECK(says_saturated(0x0201));
  CHECK_THAT(cause_of_error(0x0302), ContainsSubstring("does not answer"));
  CHECK_THAT(cause_of_error(0x7777), ContainsSubstring("reports an error"));
}

}  // namespace
}  // namespace hlm::server
