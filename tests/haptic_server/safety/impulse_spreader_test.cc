// Impulses within the device's limits (docs/method.md 5.4).
#include "hlm/haptic_server/safety/impulse_spreader.h"

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1.0 / 512;  // s

/// As fast as one likes.
LimiterOptions at_once(double max_force) {
  return {.max_force = max_force, .max_force_rate = 1e9, .max_torque_rate = 1e9};
}

ForceBudget twelve_newtons() { return ForceBudget::of(at_once(12), {}, kStep); }

/// One step, in which all that is planned is rendered.
Wrench render(ImpulseSpreader& spreader, const Wrench& impulse, const Wrench& F) {
  spreader.render(spreader.plan(impulse, F));
  return spreader.wrench();
}

TEST_CASE("An impulse beyond the force limit is spread and keeps its momentum") {
  // 0.3 kg at 0.2 m/s: 31 N for one step at 512 Hz.
  Wrench impulse = Wrench::Zero();
  impulse[1] = 0.06;  // N·s
  ImpulseSpreader spreader(twelve_newtons(), kStep);
  double momentum = 0;
  int steps = 0;
  for (Wrench F = render(spreader, impulse, Wrench::Zero()); F.norm() > 0;
       F = render(spreader, Wrench::Zero(), Wrench::Zero())) {
    CHECK(F.norm() <= 12 + 1e-9);  // N
    momentum += F[1] * kStep;
    REQUIRE(++steps < 10);
  }
  CHECK(steps == 3);
  CHECK(momentum == Approx(0.06).epsilon(1e-12));
}

TEST_CASE("An impulse within the force limit is rendered in one step") {
  Wrench impulse = Wrench::Zero();
  impulse[0] = 0.01;
  ImpulseSpreader spreader(twelve_newtons(), kStep);
  CHECK(render(spreader, impulse, Wrench::Zero())[0] == Approx(0.01 / kStep));
  CHECK(spreader.pending().norm() == 0);
}

TEST_CASE("The budget is the smaller of what the user allows and the device is rated for") {
  const DeviceRatings rated{.max_force = 12, .max_torque = 0.2};
  ImpulseSpreader spreader(ForceBudget::of(at_once(3), rated, kStep), kStep);
  Wrench impulse = Wrench::Zero();
  impulse[1] = 0.05;  // N·s: 9 steps at 3 N
  impulse[5] = 1e-5;  // N·m·s
  double momentum = 0;
  for (int i = 0; i < 12; ++i) {
    const Wrench F = render(spreader, i == 0 ? impulse : Wrench(Wrench::Zero()), Wrench::Zero());
    CHECK(F.head<3>().norm() <= 3 + 1e-9);    // N
    CHECK(F.tail<3>().norm() <= 0.2 + 1e-9);  // N·m
    momentum += F[1] * kStep;
  }
  CHECK(momentum == Approx(0.05).epsilon(1e-12));
}

TEST_CASE("On a device without torque the force of an impulse is rendered all the same") {
  ImpulseSpreader spreader(ForceBudget::of(at_once(12), {.max_torque = 0}, kStep), kStep);
  Wrench impulse = Wrench::Zero();
  impulse[0] = 0.01;   // N·s
  impulse[5] = 0.001;  // N·m·s
  const Wrench F = render(spreader, impulse, Wrench::Zero());
  CHECK(F[0] == Approx(0.01 / kStep));
  CHECK(F[5] == 0);
  CHECK(render(spreader, Wrench::Zero(), Wrench::Zero()).norm() == 0);
}

TEST_CASE("Impulses leave room for the wrench beside them") {
  Wrench impulse = Wrench::Zero();
  impulse[1] = 0.06;
  Wrench F = Wrench::Zero();
  F[0] = 6;
  F[1] = 6;
  ImpulseSpreader spreader(twelve_newtons(), kStep);
  CHECK((F + render(spreader, impulse, F)).norm() == Approx(12));
}

TEST_CASE("Pending impulses never push on for more than 20 ms") {
  Wrench impulse = Wrench::Zero();
  impulse[0] = 100;  // N·s
  ImpulseSpreader spreader(twelve_newtons(), 1e-3);
  render(spreader, impulse, Wrench::Zero());
  int steps = 1;
  while (spreader.pending().norm() > 0) {
    render(spreader, Wrench::Zero(), Wrench::Zero());
    ++steps;
  }
  CHECK(steps <= 21);
}

}  // namespace
}  // namespace hlm::server
