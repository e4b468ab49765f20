// The virtual tool follows the proxy, is stopped by walls, pushes loose bodies, and says exactly
// where it is.
#include "hlm/ve_client/world/virtual_tool.h"

#include <limits>

#include "hlm/ve_client/world/proximity.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using test::box;
using test::fixed_model;
using test::kInertial;
using test::model;
using test::world_of;

constexpr double kStep = 1.0 / 60;  // s.

/// A tool in its world.
struct Scene {
  Scene(const WorldDescription& description, const std::string& name, FollowOptions options = {})
      : assembly(assemble_tool(description, name)),
        world(description, assembly.bodies),
        tool(world, assembly, options),
        proximity(world, assembly) {}

  void step(double dt = kStep) {
    const double reach = tool.follow(dt);
    world.step(dt, proximity.within_reach(tool, reach), [&](double h) { tool.pull(h); });
    tool.read_back();
  }
  /// Follows a proxy that stands still at q.
  void follow(const Configuration& q, int steps) {
    for (int i = 0; i < steps; ++i) {
      tool.set_target(q, Velocity::Zero(tool.v().size()));
      step();
    }
  }

  ToolAssembly assembly;
  World world;
  VirtualTool tool;
  Proximity proximity;
};

/// Distance of two configurations as motions of the tool.
double distance(const ToolDescription& description, const Configuration& a,
                const Configuration& b) {
  ToolModel at_a(description);
  ToolModel at_b(description);
  at_a.set_configuration(a);
  at_b.set_configuration(b);
  double sum = 0;
  for (int link = 0; link < at_a.links(); ++link) {
    sum += displacement(at_a.X_WL(link), at_b.X_WL(link)).norm();
  }
  return sum;
}

const std::string kFree = model("tool", "0.1 0.2 0.3 0.4 0.5 0.6", "");
const std::string kPlanar =
    model("tool", "0.1 0.2 0.3 0.4 0.5 0.6", "", "<haptic:tool_joint>planar</haptic:tool_joint>");
const std::string kTree =
    "<model name='tool'><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>"
    "<link name='tip'><pose>0.4 0 0 0.3 0 0</pose>" +
    kInertial +
    "</link>"
    "<link name='root'><pose>0 0.3 0 0 0.2 0</pose>" +
    kInertial +
    "</link>"
    "<link name='slide'><pose>0 0 0.2 0 0 0.7</pose>" +
    kInertial +
    "</link>"
    "<joint name='a' type='prismatic'><pose>0.1 0 0 0.2 0 0</pose><parent>root</parent>"
    "<child>slide</child><axis><xyz>0 1 0</xyz></axis></joint>"
    "<joint name='b' type='continuous'><pose>0 0.1 0 0 0.3 0</pose><parent>slide</parent>"
    "<child>tip</child><axis><xyz>0 0.6 0.8</xyz></axis></joint></model>";

TEST_CASE("A tool whose root is welded to the world moves with the joints beyond") {
  const WorldDescription world = world_of(
      "<model name='arm'><link name='base'>" + kInertial + "</link><link name='rod'>" + kInertial +
      "</link><joint name='weld' type='fixed'><parent>world</parent><child>base</child></joint>"
      "<joint name='j' type='revolute'><parent>base</parent><child>rod</child><axis><xyz>0 0 1"
      "</xyz></axis></joint></model>");
  CHECK(world.bodies.at(0).fixed);
  Scene scene(world, "arm");
  scene.follow(Configuration::Constant(1, 0.3), 60);
  CHECK(scene.tool.q()[0] == Approx(0.3).margin(0.01));
  CHECK(scene.world.X_WB(0).p.isZero(1e-9));
}

TEST_CASE("A kinematic tool is exactly where the proxy is, with its velocity") {
  const std::string models = GENERATE(kFree, kPlanar, kTree);
  Scene scene(world_of(models), "tool", {.mode = FollowMode::kKinematic});
  test::Random random;
  Configuration q = scene.tool.q();
  for (int i = 0; i < 20; ++i) {
    const Velocity v = test::random_velocity(random, scene.assembly.description.dof(), 2);
    q = ToolModel(scene.assembly.description).integrate(q, v, kStep);
    scene.tool.set_target(q, v);
    scene.step();
    CHECK(distance(scene.assembly.description, scene.tool.q(), q) < 1e-9);
    // The mean over the frame; where rotations add up that is not quite the velocity at its end.
    CHECK((scene.tool.v() - v).norm() < 0.02 * v.norm());
  }
}

TEST_CASE("A following tool is within 6 % of a still proxy after 3 frames and at rest soon after") {
  const std::string models = GENERATE(kFree, kPlanar, kTree);
  const double rate = GENERATE(30.0, 60.0);
  Scene scene(world_of(models), "tool", {.max_force = 1e6});
  test::Random random;
  const ToolDescription& description = scene.assembly.description;
  const Velocity step = test::random_velocity(random, description.dof(), 0.02);
  const Configuration start = scene.tool.q();
  const Configuration goal = ToolModel(description).integrate(start, step, 1);
  for (int i = 0; i < 3; ++i) {
    scene.tool.set_target(goal, Velocity::Zero(description.dof()));
    scene.step(1 / rate);
  }
  CHECK(distance(description, scene.tool.q(), goal) < 0.06 * distance(description, start, goal));
  scene.follow(goal, 30);
  CHECK(distance(description, scene.tool.q(), goal) < 1e-6);
  CHECK(scene.tool.v().norm() < 1e-5);
}

TEST_CASE("A following tool ends each frame where a steadily moving proxy last was") {
  Scene scene(world_of(kFree), "tool");
  Velocity v(6);
  v << 0.1, -0.05, 0.02, 0, 0, 0;
  Configuration q = scene.tool.q();
  for (int i = 0; i < 60; ++i) {
    q.head<3>() += kStep * v.head<3>();
    scene.tool.set_target(q, v);
    scene.step();
  }
  CHECK((scene.tool.q() - q).norm() < 1e-6);
  CHECK((scene.tool.v() - v).norm() < 1e-6);
}

TEST_CASE("Without news of the proxy the tool comes to rest at its latest configuration") {
  Scene scene(world_of(kFree), "tool");
  Velocity v(6);
  v << 0.5, 0, 0, 0, 0, 0;
  const Configuration q = scene.tool.q();
  scene.tool.set_target(q, v);
  for (int i = 0; i < 30; ++i) scene.step();
  CHECK((scene.tool.q() - q).norm() < 1e-6);
}

TEST_CASE("The force that draws the tool is bounded") {
  Scene scene(world_of(kFree), "tool", {.max_force = 2});
  Configuration far = scene.tool.q();
  far[0] += 1;
  scene.follow(far, 1);
  CHECK(scene.tool.v().head<3>().norm() == Approx(2.0 * kStep).epsilon(1e-6));  // 1 kg.
}

TEST_CASE("Angles go on counting beyond a turn") {
  Scene scene(world_of(kPlanar), "tool", {.mode = FollowMode::kKinematic});
  Configuration q = scene.tool.q();
  for (int i = 0; i < 40; ++i) {
    q[2] += 0.5;
    scene.follow(q, 1);
  }
  CHECK(scene.tool.q()[2] == Approx(q[2]).margin(1e-9));
}

TEST_CASE("A linkage that is dragged by one link stays a linkage") {
  Scene scene(test::repository_world("linkage.sdf"), "arm");
  const int forearm = scene.assembly.bodies[1];
  for (int i = 0; i < 60; ++i) {
    scene.world.add_wrench(forearm, Wrench(0.2, 1, 0.5, 0, 0, 0));
    scene.world.step(kStep, {});
    scene.tool.read_back();
    ToolModel kinematics(scene.assembly.description);
    kinematics.set_configuration(scene.tool.q());
    const Pose X_WB = kinematics.X_WL(1) * scene.assembly.X_LB[1];
    CHECK(displacement(X_WB, scene.world.X_WB(forearm)).norm() < 1e-12);
  }
  CHECK(scene.tool.q().norm() > 0.5);
}

TEST_CASE("A configuration that cannot be followed is refused") {
  Scene scene(world_of(kFree), "tool");
  const Configuration q = scene.tool.q();
  const Velocity v = Velocity::Zero(6);
  CHECK(scene.tool.can_follow(q, v));
  CHECK_FALSE(scene.tool.can_follow(q.head(6), v));
  CHECK_FALSE(scene.tool.can_follow(q, v.head(5)));
  Configuration bad = q;
  bad[0] = 1e9;
  CHECK_FALSE(scene.tool.can_follow(bad, v));
  bad[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(scene.tool.can_follow(bad, v));
  bad = q;
  bad.segment<4>(3).setZero();
  CHECK_FALSE(scene.tool.can_follow(bad, v));
  CHECK_FALSE(scene.tool.can_follow(q, Velocity::Constant(6, 1e9)));
}

// With contacts: a 100 mm cube as tool, a wall whose face is at x = 0.2.
const std::string kCube = model("tool", "0 0 0 0 0 0", box("0.1 0.1 0.1"));

TEST_CASE("A wall stops the tool with less than 0.1 mm of steady penetration") {
  Scene scene(world_of(kCube + fixed_model("wall", "0.3 0 0 0 0 0", box("0.2 1 1"))), "tool");
  Configuration beyond = scene.tool.q();
  beyond[0] = 0.16;  // 10 mm into the wall.
  scene.follow(beyond, 60);
  CHECK(scene.tool.q()[0] == Approx(0.15).margin(1e-4));
  CHECK(scene.tool.v().norm() < 1e-3);
  // Its contacts are active all the time.
  for (int i = 0; i < 60; ++i) {
    scene.follow(beyond, 1);
    CHECK(scene.proximity.query(scene.tool, 0).size() == 4);
  }
}

TEST_CASE("A wall stops a fast tool without penetration") {
  Scene scene(world_of(kCube + fixed_model("wall", "0.3 0 0 0 0 0", box("0.2 1 1"))), "tool",
              {.max_force = 1e6});
  Configuration beyond = scene.tool.q();
  beyond[0] = 0.2;
  double deepest = 0;
  for (int i = 0; i < 10; ++i) {
    scene.follow(beyond, 1);
    deepest = std::max(deepest, scene.tool.q()[0] - 0.15);
  }
  CHECK(deepest > 0);
  CHECK(deepest < 1e-4);
}

TEST_CASE("A linkage is stopped by a post") {
  Scene scene(test::repository_world("linkage.sdf"), "arm");
  scene.follow(Eigen::Vector2d(-M_PI / 2, 0), 90);
  // The upper arm's box, 20 mm wide, passes the post of radius 30 mm at (0.1, -0.1) at 45 degrees,
  // less asin(40 / 141.4).
  CHECK(scene.tool.q()[0] ==
        Approx(-M_PI / 4 + std::asin(0.04 / std::hypot(0.1, 0.1))).margin(0.02));
}

TEST_CASE("The tool pushes a loose body in front of it") {
  const FollowMode mode = GENERATE(FollowMode::kImplicit, FollowMode::kKinematic);
  const std::string floor =
      "<collision name='c'><geometry><plane><normal>0 0 1</normal></plane></geometry></collision>";
  Scene scene(world_of(kCube + model("crate", "0.2 0 0 0 0 0", box("0.1 0.1 0.1")) +
                           fixed_model("floor", "0 0 -0.05 0 0 0", floor),
                       "0 0 -9.81"),
              "tool", {.mode = mode, .max_force = 100});
  Configuration q = scene.tool.q();
  Velocity v = Velocity::Zero(6);
  v[0] = 0.1;
  for (int i = 0; i < 180; ++i) {
    q[0] += kStep * v[0];
    scene.tool.set_target(q, v);
    scene.step();
  }
  // Friction of 9.8 N on the crate holds the following tool back by some millimetres.
  CHECK(scene.tool.q()[0] == Approx(0.3).margin(5e-3));
  CHECK(scene.world.X_WB(1).p.x() - scene.tool.q()[0] == Approx(0.1).margin(1e-3));
}

}  // namespace
}  // namespace hlm::ve
