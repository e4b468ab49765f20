// The ledger of the device port, and the power that its tank allows.
#include "hlm/haptic_server/safety/energy_tank.h"

#include <cmath>
#include <limits>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

Wrench push(double x) {
  Wrench F = Wrench::Zero();
  F[0] = x;
  return F;
}

Pose at(double x) {
  Pose X;
  X.p.x() = x;
  return X;
}

TEST_CASE("The ledger is wrench times way, split into what was given and taken") {
  test::Random random;
  EnergyTank tank({.capacity = 1e6});
  Pose X_WD;
  tank.observe(X_WD, Wrench::Zero(), Wrench::Zero(), 0);
  double net = 0;
  double both = 0;
  for (int i = 0; i < 1000; ++i) {
    Wrench F;
    for (double& component : F) component = random.uniform(-10, 10);
    const Vector3 move(random.uniform(-1e-3, 1e-3), random.uniform(-1e-3, 1e-3), 0);  // m
    const Vector3 turn(0, 0, random.uniform(-1e-2, 1e-2));                            // rad
    const double work = F.head<3>().dot(move) + F.tail<3>().dot(turn);
    X_WD.p += move;
    X_WD.R = Quaternion(Eigen::AngleAxisd(turn.z(), Vector3::UnitZ())) * X_WD.R;
    tank.observe(X_WD, F, Wrench::Zero(), 0);
    net += work;
    both += std::abs(work);
  }
  CHECK(tank.ledger().given - tank.ledger().taken == Approx(net).margin(1e-9));  // J
  CHECK(tank.ledger().given + tank.ledger().taken == Approx(both).margin(1e-9));
}

TEST_CASE("What is taken fills the tank up to its capacity, what is given drains it") {
  EnergyTank tank({.capacity = 0.5});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  tank.observe(at(0.1), push(-10), Wrench::Zero(), 0);  // 1 J taken
  CHECK(tank.ledger().tank == 0.5);
  tank.observe(at(0.2), push(4), Wrench::Zero(), 0);
  CHECK(tank.ledger().tank == Approx(0.1));
  CHECK(tank.allowed_power() == Approx(0.1 / EnergyTank::kDrainTime));  // W
  tank.observe(at(0.3), push(6), Wrench::Zero(), 0);
  CHECK(tank.ledger().tank == Approx(-0.5));
  CHECK_FALSE(tank.overdrawn());
  tank.observe(at(0.4), push(1), Wrench::Zero(), 0);
  CHECK(tank.overdrawn());
}

TEST_CASE(
    "A weight that the hand lifts may come down again, as often as it is lifted, by the "
    "allowance") {
  EnergyTank tank({.capacity = 0.5, .claim = 2});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  for (int lift = 0; lift < 3; ++lift) {
    for (int i = 1; i <= 20; ++i) tank.observe(at(-0.01 * i), push(9.81), push(9.81), 0);
    CHECK(tank.ledger().explained == Approx(-1.962));  // J over 0.2 m
    for (int i = 19; i >= 0; --i) tank.observe(at(-0.01 * i), push(9.81), push(9.81), 0);
    CHECK(tank.ledger().explained == Approx(0).margin(1e-9));
    CHECK(tank.ledger().tank == Approx(0.5));
  }
}

TEST_CASE("However high a weight was lifted, at a stretch it gives no more than the bound") {
  EnergyTank tank({.capacity = 0.5, .claim = 2});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  for (int i = 1; i <= 100; ++i) tank.observe(at(-0.01 * i), push(9.81), push(9.81), 0);
  double given = 0;  // J
  for (int i = 99; i >= 0 && !tank.overdrawn(); --i) {
    tank.observe(at(-0.01 * i), push(9.81), push(9.81), 0);
    given += 0.0981;
  }
  CHECK(tank.overdrawn());
  CHECK(given < tank.bound() + 0.1);  // J: to the end of the period.
}

TEST_CASE("What the client claims is let through up to its allowance, which time alone fills") {
  const bool falls = GENERATE(true, false);  // A weight that was not lifted, or a wall that pushes.
  EnergyTank tank({.capacity = 0.5, .claim = 2, .claim_power = 1});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  double x = 0;
  const auto go = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      tank.observe(at(x += 0.01), push(5), push(falls ? 5 : 0), falls ? 0 : 0.05);
    }
  };
  go(40);
  CHECK(tank.ledger().explained == Approx(2));  // J
  CHECK(tank.ledger().tank == Approx(0.5));
  go(10);
  CHECK(tank.ledger().explained == Approx(2));
  CHECK(tank.ledger().tank == Approx(0).margin(1e-9));
  tank.begin();  // Another session is no other allowance.
  go(1);
  tank.pass(0.3);
  go(40);
  CHECK(tank.ledger().explained == Approx(0.3));
  CHECK(tank.overdrawn());
  tank.pass(3600);
  CHECK(tank.ledger().tank < 0);  // Time pays for no more than is claimed.
}

TEST_CASE("Whatever is claimed the port gives no more than its bound and the power in time") {
  test::Random random;
  const EnergyLimits limits{.capacity = 0.5, .claim = 2, .claim_power = 1};
  EnergyTank tank(limits);
  double x = 0;
  double time = 0;
  double net = 0;  // J, given less taken
  for (int i = 0; i < 100'000; ++i) {
    if (random.integer(0, 500) == 0) tank.begin();
    tank.observe(at(x), Wrench::Zero(), Wrench::Zero(), 0);
    const double force = random.uniform(-10, 12);
    const double move = random.uniform(-1e-3, 1e-3);
    const bool allowed = force * move < tank.allowed_power() * 1e-3;
    const double F = allowed ? force : 0;
    x += move;
    time += 1e-3;
    tank.pass(1e-3);
    Wrench claimed = Wrench::Zero();
    claimed[0] = random.uniform(-100, 100);
    tank.observe(at(x), push(F), claimed, random.uniform(-0.1, 0.1));
    net += F * move;
    REQUIRE(net <= tank.bound() + limits.claim_power * time);
  }
}

TEST_CASE("What passes the port of a scaled device is counted at the handle, turns too") {
  EnergyTank tank({.capacity = 10, .claim = 1}, 4);
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  tank.observe(at(0.2), push(4), Wrench::Zero(), 0);  // 50 mm at the handle
  CHECK(tank.ledger().given == Approx(0.2));          // J
  tank.observe(at(0.4), push(4), push(4), 0);
  CHECK(tank.ledger().explained == Approx(0.2));
  Pose turned = at(0.4);
  turned.R = Eigen::AngleAxisd(0.5, Vector3::UnitZ());
  Wrench torque = Wrench::Zero();
  torque[5] = 0.6;
  tank.observe(turned, torque, Wrench::Zero(), 0);
  CHECK(tank.ledger().given == Approx(0.475));  // 0.3 J in the world
}

TEST_CASE(
    "A new session starts its sums anew and with the tank as it was, a person forgives debts") {
  EnergyTank tank({.capacity = 0.5});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  tank.observe(at(0.1), push(3), Wrench::Zero(), 0);
  tank.begin();
  CHECK(tank.ledger().given == 0);
  CHECK(tank.ledger().tank == Approx(0.2));
  tank.observe(at(5), push(3), Wrench::Zero(), 0);  // aligned elsewhere: no way
  CHECK(tank.ledger().tank == Approx(0.2));
  tank.observe(at(5.1), push(6), Wrench::Zero(), 0);
  tank.begin();
  CHECK(tank.ledger().tank == Approx(-0.4));
  tank.settle();
  CHECK(tank.ledger().tank == 0);
}

TEST_CASE("A ledger that is not finite counts as overdrawn, and a person at the device ends that") {
  EnergyTank tank({.capacity = 0.5});
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), 0);
  tank.observe(at(0), Wrench::Zero(), Wrench::Zero(), std::numeric_limits<double>::quiet_NaN());
  CHECK(tank.overdrawn());
  tank.begin();
  CHECK(tank.overdrawn());
  tank.settle();
  CHECK(tank.ledger().tank == 0);
  CHECK_FALSE(tank.overdrawn());
}

}  // namespace
}  // namespace hlm::server
