// The force on a device's gripper and the energy that goes through it (docs/method.md 13).
#include "hlm/haptic_server/safety/grip_port.h"

#include <cmath>
#include <numbers>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;        // s
constexpr double kTravel = 0.03;    // m
constexpr double kMost = 8;         // N
constexpr double kCapacity = 0.25;  // J

GripPort grip_of_a_device() {
  DeviceRatings device;
  device.max_gripper_force = kMost;
  device.gripper_travel = kTravel;
  ForceBudget budget;
  budget.max_force = 12;
  budget.max_force_step = 1;
  budget.energy.capacity = kCapacity;
  return {budget, device, kDt};
}

/// Opening of fingers that go to and fro at 3 Hz.
double opening(int tick) { return 0.5 - 0.5 * std::cos(6 * std::numbers::pi * kDt * tick); }

TEST_CASE("A gripper that is led along its motion gives no more than it takes and its tank") {
  const double direction = GENERATE(1.0, -1.0);  // Where the client says that it is pushed.
  GripPort grip = grip_of_a_device();
  grip.begin();
  double force = 0, given = 0, taken = 0, most = 0;
  for (int tick = 1; tick <= 30'000; ++tick) {
    const double way = (opening(tick) - opening(tick - 1)) * kTravel;
    // The first period has nothing to compare with.
    if (tick > 1) (force * way > 0 ? given : taken) += std::abs(force * way);
    grip.observe(opening(tick), false);
    most = std::max(most, given - taken);
    REQUIRE_FALSE(grip.overdrawn());
    force = grip.limit(direction * std::copysign(1e3, way), 1);
    REQUIRE(std::abs(force) <= kMost);
  }
  CHECK(grip.ledger().given == Approx(given).margin(1e-9));
  CHECK(grip.ledger().taken == Approx(taken).margin(1e-9));
  CHECK(most <= kCapacity + 0.01);  // J; the rate of the force lets some more by
  CHECK(given + taken > 0.2);
}

TEST_CASE("A gripper on a spring has the whole of its force, and gives back what it took") {
  GripPort grip = grip_of_a_device();
  grip.begin();
  double wanted = 0;
  for (int tick = 1; tick <= 10'000; ++tick) {
    grip.observe(opening(tick), false);
    wanted = 400 * std::max(0.015 - opening(tick) * kTravel, 0.0);  // N
    const double force = grip.limit(wanted, 1);
    if (tick > 10) REQUIRE(force == Approx(wanted).margin(0.01));  // It has risen.
  }
  grip.drop();
  CHECK(grip.limit(std::nan(""), 1) == 0);
}

TEST_CASE("Of a stall in which the motors may have been off only what they gave counts") {
  GripPort grip = grip_of_a_device();
  grip.begin();
  grip.observe(0.5, false);
  REQUIRE(grip.limit(1, 1) == 1);  // N, opens
  grip.observe(0.4, true);         // The hand has closed it, against what may have been no force.
  CHECK(grip.ledger().taken == 0);
}

}  // namespace
}  // namespace hlm::server
