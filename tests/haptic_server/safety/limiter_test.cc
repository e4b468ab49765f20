// The last gate before the device.
#include "hlm/haptic_server/safety/limiter.h"

#include <algorithm>
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

/// Its fades take 0.1 s; rates are the device's.
Limiter limiter_for(const DeviceRatings& device = {}) {
  return {{.max_force_rate = 1e6, .max_torque_rate = 1e6, .fade_time = 0.1}, device, kStep};
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
  CHECK(faded_in({.max_force = 3, .max_force_rate = 1e6}).limit(push(10))[1] == Approx(3));
}

TEST_CASE("Motors that bear 0.88 N for ever give 3.3 N for some seconds, then 0.88 N until cool") {
  Limiter limiter = faded_in({.max_force = 3.3, .continuous_force = 0.88, .max_force_rate = 1e6});
  const auto force_after = [&](double time, double wanted) {
    double force = 0;
    for (int i = 0; i < static_cast<int>(time / kStep); ++i) {
      limiter.allow(true);
      force = limiter.limit(push(wanted))[1];
    }
    return force;
  };
  CHECK(force_after(3, 3.3) == Approx(3.3));  // s, N
  CHECK_FALSE(limiter.cools());
  CHECK(force_after(3, 3.3) == Approx(0.88));
  CHECK(limiter.cools());
  CHECK(force_after(10, 3.3) == Approx(0.88));
  force_after(40, 0);
  CHECK_FALSE(limiter.cools());
  CHECK(force_after(1.5, 3.3) == Approx(3.3));
}

TEST_CASE("Motors that say that they get warm are given what they bear for ever") {
  Limiter limiter = faded_in({.max_force = 3.3, .continuous_force = 0.88, .max_force_rate = 1e6});
  limiter.warm(true);
  for (int i = 0; i < 1100; ++i) limiter.allow(true);  // The limit takes 1 s.
  CHECK(limiter.limit(push(3))[1] == Approx(0.88));    // N
  CHECK(limiter.cools());
  // A device that bears its peak for ever is not held back.
  Limiter other = faded_in({.max_force = 12, .max_force_rate = 1e6});
  other.warm(true);
  for (int i = 0; i < 1100; ++i) other.allow(true);
  CHECK(other.limit(push(10))[1] == Approx(10));
  CHECK_FALSE(other.cools());
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
  CHECK(limiter.level() == ForceLevel::kNone);
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
  CHECK(limiter.level() == ForceLevel::kNone);
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
  for (; limiter.level() != ForceLevel::kNone && steps < 1000; ++steps) {
    const double force = limiter.limit(push(12))[1];
    CHECK(std::abs(previous - force) <= 0.05 + 1e-9);
    previous = force;
  }
  CHECK(previous == 0);
  CHECK(steps == Approx(240).margin(1));
}

TEST_CASE("An impulse rises and falls at the rate's limit and keeps its momentum") {
  // Of 0.3 kg at 0.2 m/s, beside a wanted force that changes meanwhile, at 3 N and 0.15 N·m a step.
  const double steady = GENERATE(0.0, 2.0, -5.0, 11.0);  // N
  Limiter limiter({.fade_time = 0.1}, {}, kStep);
  limiter.allow(true);
  for (int i = 0; i < 200; ++i) limiter.limit(push(steady));
  Wrench impulse = push(-0.06);  // N·s
  impulse[5] = 0.002;            // N·m·s
  Wrench before = push(steady);
  double momentum = 0;
  double angular = 0;
  double lag = 0;
  for (int i = 0; i < 40; ++i) {
    const Wrench wanted = push(i < 20 ? steady : 0.5 * steady);
    const Wrench F = limiter.limit(wanted, i == 0 ? impulse : Wrench(Wrench::Zero()));
    CHECK(F.head<3>().norm() <= 12 + 1e-9);               // N
    CHECK(F.tail<3>().norm() <= 0.6 + 1e-9);              // N·m
    CHECK((F - before).head<3>().norm() <= 3 + 1e-9);     // N
    CHECK((F - before).tail<3>().norm() <= 0.15 + 1e-9);  // N·m
    momentum += limiter.impulse_wrench()[1] * kStep;
    angular += limiter.impulse_wrench()[5] * kStep;
    lag += (F - wanted - limiter.impulse_wrench())[1] * kStep;
    before = F;
  }
  CHECK(momentum == Approx(-0.06).epsilon(1e-9));
  CHECK(angular == Approx(0.002).epsilon(1e-9));
  CHECK(std::abs(lag) < 0.02);  // N·s: what the change of the wanted force lost to the rate
  CHECK(limiter.impulse_wrench().norm() == 0);
}

TEST_CASE("An impulse that is over in one step falls no faster than it may") {
  Limiter limiter({.max_force_rate = 1000}, {}, kStep);  // 1 N a step
  limiter.allow(true);
  for (int i = 0; i < 200; ++i) limiter.limit(push(0));
  double before = 0;
  double largest = 0;
  for (int i = 0; i < 30; ++i) {
    const double force = limiter.limit(push(0), push(i == 0 ? 0.02 : 0))[1];
    CHECK(std::abs(force - before) <= 1 + 1e-9);
    largest = std::max(largest, force);
    before = force;
  }
  CHECK(largest > 3.9);  // N: 1 + 2 + 3 + 4 + 4 + 3 + 2 + 1
  CHECK(before == 0);
}

TEST_CASE(
    "Force gives no more than its power: 12 N along 2 m/s become 7.5 N, across it they stay") {
  Limiter limiter = faded_in();
  Twist V = Twist::Zero();
  V[1] = 2;  // m/s
  const Wrench none = Wrench::Zero();
  CHECK(limiter.limit(push(12), none, V)[1] == Approx(7.5));  // 15 W
  CHECK(limiter.limited_by() == ForceLimit::kPower);
  CHECK(limiter.limit(push(-12), none, V)[1] == Approx(-12));
  CHECK(limiter.limited_by() == ForceLimit::kNone);
  Wrench across = Wrench::Zero();
  across[0] = 12;
  CHECK(limiter.limit(across, none, V)[0] == Approx(12));
}

TEST_CASE("The device's own power counts where it is lower, of force and of torque") {
  Limiter limiter = faded_in({.max_power = 5, .max_turning_power = 0.5});
  Twist V = Twist::Zero();
  V[1] = 1;  // m/s
  V[5] = 2;  // rad/s
  Wrench F = push(12);
  F[5] = 0.6;
  const Wrench& command = limiter.limit(F, Wrench::Zero(), V);
  CHECK(command[1] == Approx(5));     // N: 5 W
  CHECK(command[5] == Approx(0.25));  // N·m: 0.5 W
}

TEST_CASE("Power is that at the handle: with a scale it moves less, or more, than in the world") {
  const auto [scale, speed, force] = GENERATE(table<double, double, double>({
      {4, 4, 12},       // m/s in the world, 1 m/s at the handle: 12 W
      {4, 8, 7.5},      // 2 m/s at the handle
      {0.25, 0.5, 7.5}  // likewise
  }));
  Limiter limiter = faded_in({.scale = scale});
  Twist V = Twist::Zero();
  V[1] = speed;
  CHECK(limiter.limit(push(12), Wrench::Zero(), V)[1] == Approx(force));
  CHECK(limiter.explained(10) == Approx(std::min(10 / scale, 18.0) * kStep));  // J
}

TEST_CASE(
    "Of a turn, too: the torque of 1 N·m at the handle is scale / rotation scale in the world") {
  const DeviceRatings rated{.max_torque = 4 * 0.6, .scale = 8, .rotation_scale = 2};
  Limiter limiter = faded_in(rated);
  Twist V = Twist::Zero();
  V[5] = 20;  // rad/s in the world, 10 at the handle
  Wrench F = Wrench::Zero();
  F[5] = 2.4;
  limiter.limit(F, Wrench::Zero(), V);  // The rate allows 0.6 N·m in a step.
  // 3 W at the handle: 0.3 N·m there, 1.2 N·m in the world.
  CHECK(limiter.limit(F, Wrench::Zero(), V)[5] == Approx(1.2));
}

TEST_CASE(
    "Every limit on force is the device's where it rates less, the user's where he allows less") {
  const DeviceRatings weak{.max_force = 3,
                           .max_torque = 0.1,
                           .max_force_rate = 300,
                           .max_torque_rate = 10,
                           .max_power = 2,
                           .max_turning_power = 0.2};
  const ForceBudget of_device = ForceBudget::of({}, weak, kStep);
  CHECK(of_device.max_force == 3);
  CHECK(of_device.max_torque == 0.1);
  CHECK(of_device.max_force_step == Approx(0.3));
  CHECK(of_device.max_torque_step == Approx(0.01));
  CHECK(of_device.max_power == 2);
  CHECK(of_device.max_turning_power == 0.2);
  CHECK(of_device.energy.capacity == Approx(3 * 0.042));  // J
  const ForceBudget of_force = ForceBudget::of({}, {.max_force = 3, .max_torque = 0.1}, kStep);
  CHECK(of_force.max_force_step == Approx(0.75));  // N: 3 N in 4 ms
  CHECK(of_force.max_torque_step == Approx(0.025));
  CHECK(of_force.max_power == Approx(3.75));  // W: 3 N at 1.25 m/s
  CHECK(of_force.max_turning_power == Approx(0.5));
  const ForceBudget of_user = ForceBudget::of({}, {}, kStep);
  CHECK(of_user.max_force == 12);
  CHECK(of_user.max_torque == 0.6);
  CHECK(of_user.max_force_step == Approx(3));
  CHECK(of_user.max_torque_step == Approx(0.15));
  CHECK(of_user.max_power == 15);
  CHECK(of_user.max_turning_power == 3);
  CHECK(of_user.energy.capacity == 0.5);
}

TEST_CASE("Force that gives more than the tank holds stops, and resists until it is paid back") {
  Limiter limiter = faded_in();
  Twist V = Twist::Zero();
  V[1] = 0.5;  // m/s
  Pose X_WD;
  double given = 0;
  double command = 0;
  for (int i = 0; i < 2000; ++i) {
    limiter.observe(X_WD, 0);
    command = limiter.limit(push(10), Wrench::Zero(), V)[1];
    X_WD.p.y() += V[1] * kStep;
    given += command * V[1] * kStep;
  }
  CHECK(limiter.limited_by() == ForceLimit::kEnergy);
  CHECK(given == Approx(0.5).margin(1e-3));  // J
  CHECK(command == Approx(0).margin(1e-3));  // N
  CHECK_FALSE(limiter.overdrawn());
  // The handle is thrown ahead under full force, once: what was too much is taken back.
  X_WD.p.y() += 0.1;  // m
  for (int i = 0; i < 10; ++i) {
    limiter.observe(X_WD, 0);
    command = limiter.limit(push(-10), Wrench::Zero(), V)[1];
    X_WD.p.y() += V[1] * kStep;
  }
  CHECK(command == Approx(-10));  // N: a wall takes energy as ever
}

TEST_CASE("Energy that is owed is taken back while force is on, and not after it has faded") {
  Limiter limiter = faded_in();
  limiter.limit(push(10));
  Pose X_WD;
  limiter.observe(X_WD, 0);
  X_WD.p.y() += 0.08;  // m: 0.8 J at once, 0.3 J too much
  limiter.observe(X_WD, 0);
  Twist V = Twist::Zero();
  V[1] = 0.1;  // m/s
  const Wrench none = Wrench::Zero();
  CHECK(limiter.limit(push(10), none, V)[1] == Approx(-3));  // N: 30 N·s/m
  limiter.allow(false);
  double command = 0;
  for (int i = 0; i < 101; ++i) command = limiter.limit(push(10), none, V)[1];
  CHECK(command == Approx(0).margin(1e-9));
  CHECK(limiter.level() == ForceLevel::kNone);
}

TEST_CASE("No pause fills the tank: what it gave comes back from the hand alone") {
  Limiter limiter = faded_in();
  limiter.limit(push(10));
  Pose X_WD;
  limiter.observe(X_WD, 0);
  X_WD.p.y() += 0.05;  // m: the whole 0.5 J
  limiter.observe(X_WD, 0);
  CHECK(limiter.ledger().tank == Approx(0).margin(1e-9));
  const bool wanted = GENERATE(true, false);
  for (int i = 0; i < 3000; ++i) {
    limiter.allow(wanted);
    limiter.limit(push(10));
    limiter.observe(X_WD, 0);
  }
  CHECK(limiter.ledger().tank == Approx(0).margin(1e-9));
}

TEST_CASE("What takes energy back stays within the limits of force and torque") {
  Limiter limiter = faded_in({.max_force = 2, .max_torque = 0, .max_force_rate = 1e6});
  Wrench F = push(2);
  F[5] = 1;
  limiter.limit(F);
  Pose X_WD;
  limiter.observe(X_WD, 0);
  X_WD.p.y() += 0.4;  // m: 0.8 J at once, 0.3 J too much
  limiter.observe(X_WD, 0);
  Twist V = Twist::Zero();
  V[1] = 0.5;  // m/s: a damper of 30 N·s/m would take 15 N
  V[5] = 5;
  const Wrench& command = limiter.limit(F, Wrench::Zero(), V);
  CHECK(command[1] == Approx(-2));  // N
  CHECK(command.tail<3>().isZero(0));
}

TEST_CASE(
    "Where the port gives energy without end, as none of its limits sees it, that is a fault") {
  Limiter limiter = faded_in();
  Pose X_WD;
  int steps = 0;
  for (; !limiter.overdrawn() && steps < 1000; ++steps) {
    limiter.observe(X_WD, 0);
    limiter.limit(push(10));  // the handle's velocity is said to be zero
    X_WD.p.y() += 1e-3;
  }
  CHECK(steps == Approx(101).margin(2));  // 1 J at 10 mJ a step
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
