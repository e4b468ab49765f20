#include "ve_client/shared_bodies.h"

#include "tests/support/catch.h"
#include "tests/support/worlds.h"
#include "ve_client/world/mobility.h"

namespace hlm::ve {
namespace {

constexpr double kPeriod = 1.0 / 60;  // s
constexpr double kLoop = 0.1;         // s
constexpr double kEarth = 9.81;       // m/s²

/// A body of 1 kg that two servers know.
struct Shared {
  explicit Shared(const std::string& gravity)
      : world(test::world_of(test::model("body", "0 0 0 0 0 0", test::box("0.1 0.1 0.1")), gravity),
              {}),
        bodies(world, 2) {}

  /// A frame in which the tools push so, N along x; zero: they do not touch it.
  void push(double first, double second) {
    Pushes pushes[2];
    MovableBodies reported[2];
    for (int tool = 0; tool < 2; ++tool) {
      const double f = tool == 0 ? first : second;
      if (f == 0) continue;
      const Wrench F = (Wrench() << f, 0, 0, 0, 0, 0).finished();
      pushes[tool][0] = F;
      world.add_wrench(0, F);
      reported[tool].emplace_back().id = 0;
    }
    bodies.push(pushes, reported, kPeriod, kLoop);
    world.step(kPeriod, {});
  }

  /// What a tool's server is told.
  MovableBody report(std::size_t tool) {
    MovableBodies told;
    const Mobility mobility = mobility_of(world, 0);
    MovableBody& body = told.emplace_back();
    body.id = 0;
    body.V_W = world.V_WB(0);
    body.W = mobility.W;
    body.A_W = mobility.A_W;
    bodies.add_others(tool, told);
    return told[0];
  }

  World world;
  SharedBodies bodies;
};

TEST_CASE("What one tool does to a body reaches the other's server whole, and smoothly") {
  Shared shared("0 0 0");
  double told = 0;    // m/s: what the other's server has been told that the body gained.
  double before = 0;  // m/s²
  for (int frame = 0; frame < 120; ++frame) {
    shared.push(2, 0);
    const MovableBody body = shared.report(1);
    CHECK(body.A_W[0] - before < 0.1 * 2);  // Of 2 N on 1 kg.
    before = body.A_W[0];
    told = body.V_W[0];
  }
  CHECK(before == Approx(2).epsilon(1e-3));
  CHECK(told == Approx(shared.world.V_WB(0)[0]).epsilon(1e-3));
  CHECK(shared.report(0).A_W[0] == 0);  // The tool's own push is no force of others.
  CHECK(shared.report(0).V_W == shared.world.V_WB(0));
}

TEST_CASE("A body that two tools push resists more, and weighs the same") {
  Shared shared("0 0 -9.81");
  for (int frame = 0; frame < 60; ++frame) shared.push(3, -3);
  CHECK(shared.world.inertia_factor(0) == Approx(9).epsilon(1e-3));  // 80 kg/s for 0.1 s, and 1 kg.
  const Mobility mobility = mobility_of(shared.world, 0);
  CHECK(mobility.W(0, 0) == Approx(1.0 / 9).epsilon(1e-3));
  CHECK(mobility.A_W[2] == Approx(-kEarth / 9).epsilon(1e-3));
  const double fell = shared.world.V_WB(0)[2];
  shared.push(3, -3);
  CHECK(shared.world.V_WB(0)[2] - fell == Approx(-kEarth / 9 * kPeriod).epsilon(1e-3));

  for (int frame = 0; frame < 600; ++frame) shared.push(0, 0);
  CHECK(shared.world.inertia_factor(0) == 1);
}

TEST_CASE("Inertia comes with the momentum that the body has") {
  Shared shared("0 0 0");
  shared.world.set_velocity(0, (Twist() << 0.2, 0, 0, 0, 0, 0).finished());
  for (int frame = 0; frame < 60; ++frame) shared.push(3, -3);
  CHECK(shared.world.V_WB(0)[0] * shared.world.inertia_factor(0) == Approx(0.2).epsilon(1e-6));
}

TEST_CASE("With one tool nothing is added") {
  Shared shared("0 0 0");
  SharedBodies alone(shared.world, 1);
  const Pushes pushes{{0, (Wrench() << 2, 0, 0, 0, 0, 0).finished()}};
  MovableBodies reported;
  reported.emplace_back().id = 0;
  alone.push({&pushes, 1}, {&reported, 1}, kPeriod, kLoop);
  const MovableBodies before = reported;
  alone.add_others(0, reported);
  CHECK(reported[0].A_W == before[0].A_W);
  CHECK(reported[0].V_W == before[0].V_W);
  CHECK(shared.world.inertia_factor(0) == 1);
}

}  // namespace
}  // namespace hlm::ve
