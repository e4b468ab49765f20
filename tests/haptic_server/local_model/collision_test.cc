// Simultaneous collisions (docs/method.md 5).
#include "hlm/haptic_server/local_model/collision.h"

#include "tests/support/catch.h"
#include "tests/support/random_collision.h"

namespace hlm::server {
namespace {

using test::after;
using test::Case;
using test::collision_impulse;
using test::kinetic_energy;
using test::printed_impulse;
using test::Random;
using test::random_case;

TEST_CASE("Newton's impulse equals Eq. 11 with the printed pseudo-inverse") {
  Random random;
  const int count = GENERATE(1, 3, 6, 20, 64);
  for (const double e : {0.0, 0.5, 1.0}) {
    const Case c = random_case(random, 3, count);
    const GeneralisedForce impulse = collision_impulse(CollisionRule::kNewton, c, e);
    const Eigen::VectorXd expected = c.normals * printed_impulse(c, e);
    CHECK((impulse - expected).norm() <= 1e-7 * expected.norm());
  }
}

TEST_CASE("Newton's impulse changes kinetic energy by -(1-e²)/2 |Πu|², never up") {
  Random random;
  for (int trial = 0; trial < 200; ++trial) {
    const double e = random.uniform(0, 1);
    const Case c = random_case(random, 2, random.integer(1, 10));
    const double before = kinetic_energy(c, c.v);
    const Velocity v = after(c, collision_impulse(CollisionRule::kNewton, c, e));
    // Πu is what a plastic collision takes away.
    const Velocity plastic = after(c, collision_impulse(CollisionRule::kNewton, c, 0));
    const double projected = before - kinetic_energy(c, plastic);  // |Πu|²/2
    CHECK(std::abs(kinetic_energy(c, v) - before + (1 - e * e) * projected) <= 1e-9 * before);
  }
}

TEST_CASE("Non-negative impulses solve the complementarity problem and add no energy") {
  Random random;
  for (int trial = 0; trial < 300; ++trial) {
    const double e = random.uniform(0, 1);
    const Case c = random_case(random, random.integer(1, 5), random.integer(1, 64));
    const GeneralisedForce impulse = collision_impulse(CollisionRule::kNonnegative, c, e);
    const Velocity v = after(c, impulse);
    CHECK(kinetic_energy(c, v) <= kinetic_energy(c, c.v) * (1 + 1e-9));
    // J_c v⁺ + e J_c v⁻ >= 0 at every contact, m/s: Newton's restitution or more.
    const Eigen::VectorXd residual = c.normals.transpose() * (v + e * c.v);
    CHECK(residual.minCoeff() >= -1e-6);
    // p ⟂ residual: J_cᵀ p does no work on (v⁺ + e v⁻).
    CHECK(std::abs(impulse.dot(v + e * c.v)) <= 1e-6 * kinetic_energy(c, c.v));
  }
}

TEST_CASE("Non-negative impulses equal Eq. 11 wherever that does not pull") {
  Random random;
  int compared = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Case c = random_case(random, 2, random.integer(1, 3));
    const Eigen::VectorXd expected = printed_impulse(c, 0.3);
    if (expected.minCoeff() < 0) continue;
    ++compared;
    const GeneralisedForce impulse = collision_impulse(CollisionRule::kNonnegative, c, 0.3);
    CHECK((impulse - c.normals * expected).norm() <= 1e-7 * expected.norm());
  }
  CHECK(compared > 100);
}

TEST_CASE("Near-parallel contacts at one point let the tool slide on under p >= 0") {
  // 1 kg point moving along x and slowly down, on two planes whose normals lean 0.005 rad to
  // either side: Eq. 11 stops the sliding, the non-negative impulse takes 0.5 % of it.
  Case c;
  c.mass = MassMatrix::Identity(3, 3);
  c.D.compute(c.mass);
  c.normals.resize(3, 2);
  c.normals.col(0) << std::sin(0.005), 0, std::cos(0.005);
  c.normals.col(1) << -std::sin(0.005), 0, std::cos(0.005);
  c.v = Eigen::Vector3d(0.1, 0, -0.01);  // m/s

  const Velocity locked = after(c, collision_impulse(CollisionRule::kNewton, c, 0));
  const Velocity sliding = after(c, collision_impulse(CollisionRule::kNonnegative, c, 0));
  CHECK(std::abs(locked[0]) < 1e-9);  // m/s
  CHECK(sliding[0] > 0.099);          // m/s
}

}  // namespace
}  // namespace hlm::server
