// Force Dimension's devices, through the stand-in for the vendor's library.
#include "hlm/devices/force_dimension_device.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <string_view>
#include <thread>

#include <dlfcn.h>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/system/process.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::StartsWith;

constexpr double kDt = 1e-3;  // s.

std::unique_ptr<ForceDimensionDevice> opened(const ForceDimensionOptions& options = {}) {
  return std::make_unique<ForceDimensionDevice>(
      std::make_shared<const ForceDimensionLibrary>(HLM_STAND_IN), options, kDt);
}

/// Of all cases: the library stays open.
struct StandInOrders {
  StandInOrders() {
    std::ofstream{file};
    setenv("HAPTIC_STAND_IN_ORDERS", file.c_str(), 1);
  }
  const test::TemporaryDirectory directory;
  const std::string file = directory.file("orders");
};
const StandInOrders orders;

void order(const std::string& what) { std::ofstream(orders.file, std::ios::app) << what << '\n'; }

DeviceRatings rated(std::string_view name, bool active_wrist) {
  return force_dimension_ratings(model_of(force_dimension_models(), name), active_wrist, {}, kDt);
}

TEST_CASE("A device is rated by its name, and one that is not known gets little force") {
  CHECK(rated("omega.3", false).max_force == 12);            // N
  CHECK(rated("omega.3", false).max_stiffness == 5000);      // N/m
  CHECK(rated("omega.6", false).max_torque == 0);            // N·m
  CHECK(rated("omega.7", false).max_gripper_force == 8);     // N
  CHECK(rated("sigma.7", true).max_torque == 0.2);           // N·m
  CHECK(rated("sigma.7", true).max_angular_stiffness == 1);  // N·m/rad
  CHECK(rated("lambda.7", true).max_stiffness == 8000);      // N/m
  CHECK(rated("lambda.7", true).max_force == 12);            // N
  CHECK(rated("lambda.7", true).max_torque == 0.2);          // N·m
  CHECK(rated("delta.3", false).max_force == 20);            // N
  CHECK(rated("epsilon.9", true).max_force == 5);            // N
}

/// What the stand-in's gripper was given, N.
double gripper_force() {
  void* const library = dlopen(HLM_STAND_IN, RTLD_NOW | RTLD_NOLOAD);
  REQUIRE(library != nullptr);
  const auto told = reinterpret_cast<double (*)()>(dlsym(library, "haptic_stand_in_gripper_force"));
  const double force = told();
  dlclose(library);
  return force;
}

TEST_CASE("A gripper is given the commanded force, up to its rating, and none to begin with") {
  setenv("HAPTIC_STAND_IN_MODEL", "omega.7", 1);
  const auto device = opened();
  device->enable();
  device->write(Wrench::Zero());
  CHECK(gripper_force() == 0);
  device->grip(3);
  device->write(Wrench::Zero());
  CHECK(gripper_force() == 3);  // N
  device->grip(-20);
  device->write(Wrench::Zero());
  CHECK(gripper_force() == -8);  // N
  device->grip(std::nan(""));
  device->write(Wrench::Zero());
  CHECK(gripper_force() == 0);
  unsetenv("HAPTIC_STAND_IN_MODEL");
}

TEST_CASE("A device without a wrist, and a speed that is not there yet, are no faults") {
  for (const char* model : {"omega.3", "delta.3", "Falcon.3", "sigma.7"}) {
    CAPTURE(model);
    setenv("HAPTIC_STAND_IN_MODEL", model, 1);
    const auto device = opened({.velocity_cutoff = GENERATE(0.0, 100.0)});  // Hz
    device->calibrate();
    device->enable();
    for (int i = 0; i < 3; ++i) {
      CHECK(device->read());
      CHECK(device->write(Wrench::Zero()));
    }
    INFO(device->cause());
  }
  unsetenv("HAPTIC_STAND_IN_MODEL");
}

TEST_CASE("The mass is what the library says of this session, or else the model's") {
  setenv("HAPTIC_STAND_IN_MODEL", "omega.6", 1);
  CHECK(opened()->ratings().mass == Approx(0.3));      // kg
  CHECK(opened()->ratings().inertia == Approx(2e-3));  // kg·m²
  setenv("HAPTIC_STAND_IN_STATE", "no_inertia", 1);
  CHECK(opened()->ratings().mass == Approx(0.25));  // kg
  unsetenv("HAPTIC_STAND_IN_STATE");
  unsetenv("HAPTIC_STAND_IN_MODEL");
}

TEST_CASE("A closed gripper is button 1: the clutch of a device without buttons") {
  setenv("HAPTIC_STAND_IN_MODEL", "omega.7", 1);
  const auto device = opened();
  device->enable();
  order("press 0");
  CHECK(test::wait_until(1, [&] { return (device->read()->buttons & 1) != 0; }));
  order("release 0");
  CHECK(test::wait_until(1, [&] { return (device->read()->buttons & 1) == 0; }));
  unsetenv("HAPTIC_STAND_IN_MODEL");
}

TEST_CASE("A device is what its library says: wrist, gripper, watchdog") {
  setenv("HAPTIC_STAND_IN_MODEL", "omega.3", 1);
  const auto omega = opened({.watchdog = 0.01});
  CHECK(omega->ratings().freedoms == 0b000111);
  CHECK(omega->ratings().max_torque == 0);
  CHECK_FALSE(omega->ratings().gripper);
  CHECK(omega->ratings().time_guard == 0.01);  // s
  CHECK_FALSE(omega->ratings().halts);
}

TEST_CASE("A tick allocates nothing") {
  const auto device = opened();
  const test::NoMalloc guard;
  device->align(Pose{});
  device->enable();
  bool works = true;
  for (int i = 0; i < 100; ++i) works &= device->read() && device->write(Wrench::Zero());
  device->disable();
  const std::size_t allocations = guard.allocations();
  CHECK(works);
  CHECK(allocations == 0);
}

/// A call of an open device fails, and it is lost.
void lose(ForceDimensionDevice& device) {
  device.enable();
  order("error");
  REQUIRE(test::wait_until(1, [&] { return !device.read(); }));
  device.disable();
}

bool works(ForceDimensionDevice& device) {
  device.enable();
  return device.read().has_value();
}

/// A hand draws the handle by 0.1 m, and a stop holds it on its way. Whether the device works for
/// 0.2 s from there.
bool endures_stop(ForceDimensionDevice& device) {
  device.enable();
  order("hold 0 0 0");
  if (!test::wait_until(3, [&] {
        return device.read() && device.write(Wrench::Zero()) &&
               std::abs(device.read()->X_WD.p.y()) < 1e-3;
      })) {
    return false;
  }
  order("hold 0 0.1 0");
  if (!test::wait_until(3, [&] {
        return device.read() && device.write(Wrench::Zero()) && device.read()->V_WD[1] > 0.05;
      })) {
    return false;
  }
  order("stop");
  bool works = true;
  for (int i = 0; i < 200; ++i) {
    works = works && device.read() && device.write(Wrench::Zero());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  order("good\nlet_go");
  std::this_thread::sleep_for(std::chrono::milliseconds(30));  // Where it went is not known.
  return works;
}

TEST_CASE("A handle that a stop holds is no fault, with a mean over 2 ms or the vendor's 20 ms") {
  const bool keeps_its_own = GENERATE(false, true);
  INFO("keeps its own window: " << keeps_its_own);
  if (keeps_its_own) setenv("HAPTIC_STAND_IN_STATE", "own_window", 1);
  const auto device = opened({.watchdog = 0.03, .velocity_window = 2e-3});
  int endured = 0;
  for (int i = 0; i < 5; ++i) endured += endures_stop(*device) ? 1 : 0;
  INFO(device->cause());
  CHECK(endured == 5);
  unsetenv("HAPTIC_STAND_IN_STATE");
}

TEST_CASE("A pose that jumps by 50 mm while its speed is 0 is a fault") {
  const auto device = opened({.watchdog = 0.03});
  device->enable();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  REQUIRE(device->read());
  order("jump");
  CHECK(test::wait_until(1, [&] { return !device->read(); }));
  CHECK_THAT(device->cause(), StartsWith("its pose jumps") || StartsWith("its pose moves"));
  order("good");
}

TEST_CASE("A device that was lost is used again only with the watchdog that it had") {
  const auto device = opened();
  order("broken");
  lose(*device);
  order("good\nbroken");
  CHECK(test::wait_until(
      2, [&] { return std::string(device->cause()) == "its watchdog cannot be set as before"; }));
  CHECK_FALSE(works(*device));
  order("good");
  CHECK(test::wait_until(2, [&] { return works(*device); }));
  CHECK(std::string(device->cause()).empty());
}

TEST_CASE("Another device in the place of one that was lost is refused: its ratings are others") {
  setenv("HAPTIC_STAND_IN_MODEL", "sigma.7", 1);
  const auto device = opened();
  setenv("HAPTIC_STAND_IN_MODEL", "omega.3", 1);
  lose(*device);
  order("good");
  CHECK(test::wait_until(2, [&] {
    return std::string(device->cause()).starts_with("another device is in its place");
  }));
  CHECK_FALSE(works(*device));
}

TEST_CASE("A device in reset or without power is named, with what to do, before it is used") {
  const auto device = opened();
  setenv("HAPTIC_STAND_IN_STATE", "no_power", 1);
  CHECK_THROWS_WITH(device->calibrate(), ContainsSubstring("has no power: switch it on"));
  setenv("HAPTIC_STAND_IN_STATE", "reset", 1);
  CHECK_THROWS_WITH(device->calibrate(),
                    ContainsSubstring("is not calibrated") && ContainsSubstring("auto-init=true"));
  unsetenv("HAPTIC_STAND_IN_STATE");
  CHECK_NOTHROW(device->calibrate());
}

TEST_CASE("A device in reset is calibrated by the library if that is asked, its motors then off") {
  setenv("HAPTIC_STAND_IN_STATE", "reset", 1);
  const auto device = opened({.auto_init = true});
  CHECK_NOTHROW(device->calibrate());
  device->enable();
  CHECK(device->read());
  unsetenv("HAPTIC_STAND_IN_STATE");
}

TEST_CASE("A gripper of the left hand has negative angles, and is open where it is open") {
  const std::string model = GENERATE("sigma.7", "omega.7 (left-hand)", "lambda.7");
  INFO(model);
  setenv("HAPTIC_STAND_IN_MODEL", model.c_str(), 1);
  const auto device = opened();
  device->enable();
  CHECK(device->read()->gripper == 1);
  order("press 0");
  CHECK(test::wait_until(1, [&] { return device->read()->gripper == 0; }));
  order("release 0");
  CHECK(test::wait_until(1, [&] { return device->read()->gripper == 1; }));
  setenv("HAPTIC_STAND_IN_MODEL", "sigma.7", 1);
}

TEST_CASE("A device that is not there is named, with what to check") {
  CHECK_THROWS_WITH(opened({.number = 3}), ContainsSubstring("number 3 can be opened through") &&
                                               ContainsSubstring("no device found") &&
                                               ContainsSubstring("check its power"));
  CHECK_THROWS_WITH(opened({.serial = 7}), ContainsSubstring("with serial number 7"));
}

TEST_CASE("A library without the vendor's functions is refused by the one that it lacks") {
  CHECK_THROWS_WITH(ForceDimensionLibrary("libm.so.6"),
                    ContainsSubstring("libm.so.6 has no function dhdGetDeviceCount"));
}

}  // namespace
}  // namespace hlm::server
