#include "hlm/ve_client/run/shared_bodies.h"

#include "hlm/ve_client/world/mobility.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

constexpr double kPeriod = 1.0 / 60;  // s
constexpr double kRoundTrip = 0.05;   // s: with three frames a loop of 0.1 s.
constexpr double kEarth = 9.81;       // m/s²

/// A body of 1 kg that two servers know.
struct Shared {
  explicit Shared(const std::string& gravity)
      : world(test::world_of(test::model("body", "0 0 0 0 0 0", test::box("0.1 0.1 0.1")), gravity),
              {}),
        bodies(world, 2) {}

  /// A frame in which the tools push so, N along x; zero: they do not touch it.
  void push(double first, double second, double period = kPeriod, double round_trip = kRoundTrip,
            bool several = true) {
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
    bodies.push(pushes, reported, period, round_trip, several);
    world.step(period, {});
  }

  /// What a tool's server is told.
  MovableBody report(std::size_t tool) {
    MovableBodies told;
    const Mobility mobility = world.mobility_of(0);
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
  for (int frame = 0; frame < 200; ++frame) {
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

TEST_CASE("Where a tool has left a body, the other's server soon knows how it moves") {
  Shared shared("0 0 0");
  for (int frame = 0; frame < 200; ++frame) shared.push(2, 0);
  double ahead = 0;  // m: of the world's body, by what its server was told.
  for (int frame = 0; frame < 120; ++frame) {
    shared.push(0, 0);
    ahead += kPeriod * (shared.report(1).V_W[0] - shared.world.V_WB(0)[0]);
  }
  CHECK(std::abs(ahead) < 0.06);  // 2 m/s², a loop of 0.1 s, and what is left after another.
  CHECK(shared.report(1).A_W[0] == Approx(0).margin(1e-3));
}

TEST_CASE("Impulses that come late and then together are told whole") {
  Shared shared("0 0 0");
  double told = 0;  // m/s²
  for (int frame = 0; frame < 300; ++frame) {
    shared.push(frame % 2 == 0 ? 0 : 4, 0);
    if (frame >= 200) told += shared.report(1).A_W[0] / 100;
  }
  CHECK(told == Approx(2).epsilon(0.01));
}

TEST_CASE("A body that two tools push resists more, and weighs the same") {
  Shared shared("0 0 -9.81");
  for (int frame = 0; frame < 60; ++frame) shared.push(3, -3);
  CHECK(shared.world.inertia_factor(0) == Approx(9).epsilon(1e-3));  // 80 kg/s for 0.1 s, and 1 kg.
  const Mobility mobility = shared.world.mobility_of(0);
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

TEST_CASE("A body that two tools hold keeps its momentum however uneven frames and network are") {
  Shared shared("0 0 0");
  shared.world.set_velocity(0, (Twist() << 0.2, 0, 0, 0, 0, 0).finished());
  test::Random random;
  for (int frame = 0; frame < 600; ++frame) {
    shared.push(3, -3, 1 / random.uniform(30, 60), random.uniform(0, 0.1));
    CHECK(shared.world.V_WB(0)[0] * shared.world.inertia_factor(0) == Approx(0.2).epsilon(1e-6));
  }
}

TEST_CASE("A packet that is seconds late adds no more mass than the longest round trip") {
  Shared shared("0 0 0");
  for (int frame = 0; frame < 600; ++frame) shared.push(3, -3, kPeriod, 5);
  CHECK(shared.world.inertia_factor(0) == Approx(1 + 80 * 0.25).epsilon(1e-3));
}

TEST_CASE("Of two bodies that both servers know, only what both hands push gets heavy") {
  // They float beside each other, 0.2 mm into each other, or 0.1 m apart.
  const auto [apart, presses] =
      GENERATE(Catch::Generators::table<double, bool>({{0.0998, true}, {0.2, false}}));
  World world(test::world_of(test::model("left", "0 0 0 0 0 0", test::box("0.1 0.1 0.1")) +
                             test::model("right", std::to_string(apart) + " 0 0 0 0 0",
                                         test::box("0.1 0.1 0.1"))),
              {});
  SharedBodies bodies(world, 2);
  MovableBodies both;
  both.emplace_back().id = 0;
  both.emplace_back().id = 1;
  const MovableBodies reported[2] = {both, both};
  const Wrench F = (Wrench() << 3, 0, 0, 0, 0, 0).finished();
  const Pushes pushes[2] = {{{0, F}}, {{1, -F}}};
  for (int frame = 0; frame < 12; ++frame) {
    for (const Pushes& push : pushes) {
      if (presses) world.add_wrench(push.begin()->first, push.begin()->second);
    }
    bodies.push(pushes, reported, kPeriod, kRoundTrip, true);
    world.step(kPeriod, {});
  }
  for (const int body : {0, 1}) CHECK((world.inertia_factor(body) > 2) == presses);
}

TEST_CASE("Where one hand is left a body has its own mass at once") {
  Shared shared("0 0 0");
  for (int frame = 0; frame < 60; ++frame) shared.push(2, -2);
  CHECK(shared.world.inertia_factor(0) > 2);
  shared.push(2, 0);
  CHECK(shared.world.inertia_factor(0) > 2);
  shared.push(2, 0, kPeriod, kRoundTrip, false);
  CHECK(shared.world.inertia_factor(0) == 1);
}

TEST_CASE("With one tool nothing is added") {
  Shared shared("0 0 0");
  SharedBodies alone(shared.world, 1);
  const Pushes pushes{{0, (Wrench() << 2, 0, 0, 0, 0, 0).finished()}};
  MovableBodies reported;
  reported.emplace_back().id = 0;
  alone.push({&pushes, 1}, {&reported, 1}, kPeriod, kRoundTrip, false);
  const MovableBodies before = reported;
  alone.add_others(0, reported);
  CHECK(reported[0].A_W == before[0].A_W);
  CHECK(reported[0].V_W == before[0].V_W);
  CHECK(shared.world.inertia_factor(0) == 1);
}

}  // namespace
}  // namespace hlm::ve
