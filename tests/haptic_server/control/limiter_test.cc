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

Limiter limiter_for(const DeviceRatings& device = {}) {
  return {ForceBudget::of(12, 0.6, device, kStep), /*fade_time=*/0.1, kStep};
}

Limiter faded_in(const DeviceRatings& device = {}) {
  Limiter limiter = limiter_for(device);
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

TEST_CASE("What limits the force is reported: fade, force, torque or rate, or nothing") {
  Limiter limiter = limiter_for({.max_force_rate = 5e3});
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

TEST_CASE("Torque changes by no more than the device's rate") {
  DeviceRatings device;
  device.max_torque_rate = 10;  // N·m/s: 0.01 N·m a step
  Limiter limiter = faded_in(device);
  Wrench turn = Wrench::Zero();
  turn[5] = 0.05;
  CHECK(limiter.limit(turn)[5] == Approx(0.01));
  CHECK(limiter.limited_by() == ForceLimit::kRate);
  CHECK(limiter.limit(turn)[5] == Approx(0.02));
  CHECK(limiter.limit(-turn)[5] == Approx(0.01));
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

TEST_CASE("A wanted force above the limit fades from the limit, out and in, without a step") {
  Limiter limiter = faded_in();
  const double fade_step = 12 / 100.0;  // N
  for (int i = 0; i < 20; ++i) limiter.limit(push(20));
  limiter.allow(false);
  double previous = 12;
  for (int i = 0; i < 110; ++i) {
    const double force = limiter.limit(push(20))[1];
    CHECK(previous - force == Approx(i < 100 ? fade_step : 0).margin(1e-9));
    CHECK(limiter.limited_by() == ForceLimit::kFade);
    previous = force;
  }
  CHECK(limiter.silent());
  limiter.allow(true);
  for (int i = 0; i < 100; ++i) {
    const double force = limiter.limit(push(20))[1];
    CHECK(force - previous == Approx(fade_step));
    previous = force;
  }
}

TEST_CASE("A fade faster than the device's rate goes on at that rate, to the end") {
  const DeviceRatings device{.max_force_rate = 50};  // N/s: 0.05 N a step
  Limiter limiter = limiter_for(device);
  limiter.allow(true);
  for (int i = 0; i < 300; ++i) limiter.limit(push(12));
  limiter.allow(false);
  double previous = 12;
  int steps = 0;
  for (; !limiter.silent() && steps < 1000; ++steps) {
    const double force = limiter.limit(push(12))[1];
    CHECK(std::abs(previous - force) <= 0.05 + 1e-9);
    previous = force;
  }
  CHECK(previous == 0);
  CHECK(steps == Approx(240).margin(1));
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
