// The last gate before the device.
#include "haptic_server/control/limiter.h"

#include <limits>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s

Wrench push(double force) {
  Wrench F = Wrench::Zero();
  F[1] = force;
  return F;
}

Limiter faded_in(DeviceRatings device = {}) {
  Limiter limiter({}, device, kStep);
  limiter.allow(true);
  for (int i = 0; i < 200; ++i) limiter.limit(Wrench::Zero());
  return limiter;
}

TEST_CASE("Force is limited in magnitude, its direction kept") {
  Limiter limiter = faded_in();
  Wrench F = Wrench::Zero();
  F << 30, 40, 0, 0, 0, 5;
  const Wrench limited = limiter.limit(F);
  CHECK(limited.head<3>().norm() == Approx(12));  // N
  CHECK(limited[0] / limited[1] == Approx(0.75));
  CHECK(limited[5] == Approx(0.6));  // N·m
}

TEST_CASE("What limits the force is told: fade, force, torque or rate, or nothing") {
  using protocol::ForceLimit;
  Limiter limiter({}, {.max_force_rate = 5e3}, kStep);
  limiter.allow(true);
  limiter.limit(push(1));
  CHECK(limiter.limited_by() == ForceLimit::kFade);
  for (int i = 0; i < 200; ++i) limiter.limit(push(1));
  CHECK(limiter.limited_by() == ForceLimit::kNone);
  limiter.limit(push(9));  // 8 N more, 5 N a step
  CHECK(limiter.limited_by() == ForceLimit::kRate);
  limiter.limit(push(9));
  CHECK(limiter.limited_by() == ForceLimit::kNone);
  limiter.limit(push(13));
  CHECK(limiter.limited_by() == ForceLimit::kForce);
  Wrench turn = Wrench::Zero();
  turn[5] = 1;
  limiter.limit(turn);
  CHECK(limiter.limited_by() == ForceLimit::kTorque);
}

TEST_CASE("The device's own rating counts where it is lower") {
  DeviceRatings device;
  device.max_force = 3;
  CHECK(faded_in(device).limit(push(10))[1] == Approx(3));
}

TEST_CASE("Force changes by no more than the device's rate") {
  DeviceRatings device;
  device.max_force_rate = 1000;  // N/s: 1 N a step
  Limiter limiter = faded_in(device);
  CHECK(limiter.limit(push(5))[1] == Approx(1));
  CHECK(limiter.limit(push(5))[1] == Approx(2));
  CHECK(limiter.limit(push(-5))[1] == Approx(1));
}

TEST_CASE("Force fades to zero in the fade time, and in again") {
  Limiter limiter = faded_in();
  limiter.allow(false);
  double previous = 10;
  for (int i = 0; i < 100; ++i) {
    const double force = limiter.limit(push(10))[1];
    CHECK(force <= previous);
    previous = force;
  }
  CHECK(limiter.limit(push(10)).norm() < 1e-12);
  CHECK(limiter.silent());
  limiter.allow(true);
  CHECK(limiter.limit(push(10))[1] == Approx(0.1));  // 1 % of 10 N after 1 ms of 100
}

TEST_CASE("A wrench that is not finite gives zero force and is noted") {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Limiter limiter = faded_in();
    CHECK(limiter.limit(push(bad)).norm() == 0);
    CHECK(limiter.met_non_finite());
    limiter.limit(push(1));
    CHECK_FALSE(limiter.met_non_finite());
  }
}

TEST_CASE("Cut force is zero at once") {
  Limiter limiter = faded_in();
  limiter.limit(push(10));
  limiter.cut();
  CHECK(limiter.limit(push(10)).norm() == 0);
}

}  // namespace
}  // namespace hlm::server
