// Bodies at rest: which they are, what wakes them, and that nothing else shows it.
#include "hlm/ve_client/world/rest.h"

#include "hlm/ve_client/world/world.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using test::fixed_model;
using test::model;
using test::world_of;

constexpr double kStep = 1.0 / 60;  // s
const std::string kEarth = "0 0 -9.81";
const std::string kTable =
    fixed_model("table", "0 0 0 0 0 0",
                "<collision name='c'><geometry><plane><normal>0 0 1</normal></plane></geometry>"
                "</collision>");

std::string cube(const std::string& name, const std::string& pose) {
  return model(name, pose, test::box("0.1 0.1 0.1"));
}

void run(World& world, double duration) {
  for (double t = 0; t < duration - kStep / 2; t += kStep) world.step(kStep, {});
}

Wrench along_x(double force) {
  Wrench F = Wrench::Zero();
  F.x() = force;
  return F;
}

/// Two cubes on a third, and one far away.
WorldDescription piles() {
  return world_of(kTable + cube("low", "0 0 0.05 0 0 0") + cube("middle", "0 0 0.15 0 0 0") +
                      cube("high", "0 0 0.25 0 0 0") + cube("far", "1 0 0.05 0 0 0"),
                  kEarth);
}

TEST_CASE("A pile comes to rest as a whole, and keeps its places and loads") {
  World world(piles(), {});
  world.step(kStep, {});
  CHECK_FALSE(world.rests(1));
  run(world, 1);
  for (int body = 1; body <= 4; ++body) CHECK(world.rests(body));
  const double load = world.loads().load(1, 2);
  CHECK(load == Approx(2 * 9.81).epsilon(0.01));
  const Vector3 p_W = world.X_WB(3).p;
  run(world, 1);
  CHECK(world.loads().load(1, 2) == load);
  CHECK(world.X_WB(3).p == p_W);
}

TEST_CASE("A push wakes the whole pile that it touches, and no other") {
  World world(piles(), {});
  run(world, 1.5);
  world.add_wrench(3, along_x(1));  // Less than its friction.
  world.step(kStep, {});
  for (int body = 1; body <= 3; ++body) CHECK_FALSE(world.rests(body));
  CHECK(world.rests(4));
  CHECK(world.loads().load(1, 2) == Approx(2 * 9.81).epsilon(0.02));
  run(world, 0.4);
  CHECK_FALSE(world.rests(1));
  run(world, 1);
  for (int body = 1; body <= 3; ++body) CHECK(world.rests(body));
}

TEST_CASE("A row of cubes that rests passes a hit on as one that is awake") {
  const auto hit = [](bool rested) {
    World world(world_of(kTable + cube("a", "0 0 0.05 0 0 0") + cube("b", "0.0999 0 0.05 0 0 0") +
                             cube("c", "-0.3 0 0.05 0 0 0"),
                         kEarth),
                {});
    for (int i = 0; i < 60; ++i) {
      for (int body = 1; body <= 3 && !rested; ++body) world.add_wrench(body, along_x(1e-12));
      world.step(kStep, {});
    }
    CHECK(world.rests(1) == rested);
    world.set_velocity(3, (Twist() << 3, 0, 0, 0, 0, 0).finished());
    run(world, 1);
    return std::pair(world.X_WB(1).p.x(), world.X_WB(2).p.x());
  };
  const auto [a, b] = hit(true);
  const auto [awake_a, awake_b] = hit(false);
  CHECK(b > 0.15);
  CHECK(a == Approx(awake_a).margin(1e-3));  // m
  CHECK(b == Approx(awake_b).margin(1e-3));
}

TEST_CASE("What floats, hangs on a joint or lies on what does so never rests") {
  World world(world_of(cube("floats", "0 0 1 0 0 0") +
                       "<model name='lamp'><link name='body'><pose>1 0 0 0 0 0</pose>" +
                       test::kInertial + test::box("0.1 0.1 0.1") +
                       "</link><joint name='j' type='revolute'><parent>world</parent><child>body"
                       "</child><axis><xyz>0 1 0</xyz></axis></joint></model>"),
              {});
  run(world, 1.5);
  CHECK_FALSE(world.rests(0));
  CHECK_FALSE(world.rests(1));
}

TEST_CASE("What the tool touches or is about to touch does not rest") {
  World world(world_of(kTable + cube("near", "0 0 0.05 0 0 0") + cube("far", "1 0 0.05 0 0 0") +
                           cube("tool", "-0.2 0 0.05 0 0 0"),
                       kEarth),
              std::vector<int>{3});
  run(world, 1);
  CHECK(world.rests(1));
  ToolContact contact;
  contact.tool_body = 3;
  contact.body = 1;
  contact.p_W = {-0.05, 0, 0.05};
  contact.n_W = -Vector3::UnitX();
  contact.separation = 0.1;
  for (int i = 0; i < 60; ++i) world.step(kStep, std::vector{contact});
  CHECK_FALSE(world.rests(1));
  CHECK(world.rests(2));
}

TEST_CASE("A body that is placed elsewhere wakes what rested on it") {
  World world(piles(), {});
  run(world, 1.5);
  world.set_pose(1, {Vector3(0, 2, 0.05), Quaternion::Identity()});
  run(world, 1.5);
  CHECK(world.X_WB(3).p.z() == Approx(0.15).margin(1e-3));
}

}  // namespace
}  // namespace hlm::ve
