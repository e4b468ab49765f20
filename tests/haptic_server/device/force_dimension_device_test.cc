// Force Dimension's devices, through the stand-in for the vendor's library.
#include "hlm/device/force_dimension_device.h"

#include <cstdlib>
#include <fstream>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/system/process.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

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

TEST_CASE("A device is rated by its name, and one that is not known gets little force") {
  CHECK(force_dimension_ratings("omega.3", false).max_force == 12);            // N
  CHECK(force_dimension_ratings("omega.3", false).max_stiffness == 5000);      // N/m
  CHECK(force_dimension_ratings("omega.6", false).max_torque == 0);            // N·m
  CHECK(force_dimension_ratings("sigma.7", true).max_torque == 0.2);           // N·m
  CHECK(force_dimension_ratings("sigma.7", true).max_angular_stiffness == 1);  // N·m/rad
  CHECK(force_dimension_ratings("lambda.7", true).max_stiffness == 8000);      // N/m
  CHECK(force_dimension_ratings("epsilon.9", true).max_force == 5);            // N
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
