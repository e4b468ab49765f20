// The simulated world: gravity, contacts among loose bodies, joints and their limits,
// repeatability.
#include "hlm/ve_client/world/world.h"

#include <cmath>
#include <thread>

#include "hlm/ve_client/scene/tool_assembly.h"
#include "hlm/ve_client/world/mobility.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using test::fixed_model;
using test::kInertial;
using test::model;
using test::world_of;

constexpr double kStep = 1.0 / 60;  // s.
const std::string kEarth = "0 0 -9.81";

void run(World& world, double duration) {
  for (int i = 0; i < static_cast<int>(std::lround(duration / kStep)); ++i) world.step(kStep, {});
}

TEST_CASE("A body falls with the world's gravity unless it is weightless or the tool") {
  const WorldDescription description =
      world_of(model("stone", "0 0 0 0 0 0", "") +
                   model("balloon", "1 0 0 0 0 0", "<gravity>false</gravity>") +
                   model("tool", "2 0 0 0 0 0", ""),
               kEarth);
  World world(description, std::vector<int>{2});
  run(world, 1);
  CHECK(world.V_WB(0)[2] == Approx(-9.81).margin(1e-9));
  CHECK(world.V_WB(1).isZero(0));
  CHECK(world.V_WB(2).isZero(0));
}

std::string shape_collision(const std::string& shape) {
  const std::string geometry =
      shape == "box"        ? "<box><size>0.1 0.1 0.1</size></box>"
      : shape == "sphere"   ? "<sphere><radius>0.05</radius></sphere>"
      : shape == "cylinder" ? "<cylinder><radius>0.05</radius><length>0.1</length></cylinder>"
      : shape == "capsule"  ? "<capsule><radius>0.05</radius><length>0.1</length></capsule>"
                            : "<plane><normal>0 0 1</normal></plane>";
  return "<collision name='c'><geometry>" + geometry + "</geometry></collision>";
}

TEST_CASE("A body of each shape comes to rest on a fixed body of each shape") {
  const std::string lower =
      GENERATE(as<std::string>{}, "plane", "box", "sphere", "cylinder", "capsule");
  const std::string upper = GENERATE(as<std::string>{}, "box", "sphere", "cylinder", "capsule");
  CAPTURE(lower, upper);
  const auto half_height = [](const std::string& shape) {
    return shape == "plane" ? 0.0 : shape == "capsule" ? 0.1 : 0.05;
  };
  const double touching = half_height(lower) + half_height(upper);
  // Exactly on top of each other: balanced, also on a sphere.
  World world(world_of(fixed_model("lower", "0 0 0 0 0 0", shape_collision(lower)) +
                           model("upper", "0 0 " + std::to_string(touching + 0.01) + " 0 0 0",
                                 shape_collision(upper)),
                       kEarth),
              {});
  run(world, 0.5);
  CHECK(world.X_WB(1).p.z() == Approx(touching).margin(2e-3));
}

TEST_CASE("A box on a slope slides if its friction is below the slope's, and stays if above") {
  const auto drift = [](double mu) {
    const std::string collision =
        "<collision name='c'><geometry><box><size>0.1 0.1 0.1</size></box></geometry><surface>"
        "<friction><ode><mu>" +
        std::to_string(mu) + "</mu></ode></friction></surface></collision>";
    // Gravity 20 degrees off the plane's normal: tan = 0.364.
    World world(world_of(fixed_model("floor", "0 0 0 0 0 0", shape_collision("plane")) +
                             model("block", "0 0 0.05 0 0 0", collision),
                         "3.355 0 -9.218"),
                {});
    run(world, 1);
    return world.X_WB(1).p.x();
  };
  CHECK(std::abs(drift(0.5)) < 0.01);
  // a = g (sin - mu cos) = 1.51 m/s²: 0.76 m in 1 s.
  CHECK(drift(0.2) == Approx(0.76).margin(0.05));
}

std::string jointed(const std::string& type, const std::string& axis) {
  return "<model name='m'><link name='l'><pose>0.1 0 0 0 0 0</pose>" + kInertial +
         "</link><joint name='j' type='" + type +
         "'><pose>-0.1 0 0 0 0 0</pose><parent>world</parent><child>l</child><axis><xyz>" + axis +
         "</xyz><limit><lower>-0.2</lower><upper>0.7</upper></limit></axis></joint></model>";
}

TEST_CASE("A revolute joint turns about its axis between its limits") {
  World world(world_of(jointed("revolute", "0 0 1")), {});
  const double direction = GENERATE(1.0, -1.0);
  for (int i = 0; i < 120; ++i) {
    world.add_wrench(0, Wrench(0, 0, 0, 0, 0, 0.05 * direction));
    world.step(kStep, {});
  }
  const Pose X_WB = world.X_WB(0);
  const double angle = rotation_vector(X_WB.R).z();
  CHECK(angle == Approx(direction > 0 ? 0.7 : -0.2).margin(0.02));
  CHECK((X_WB * Vector3(-0.1, 0, 0)).norm() < 1e-3);
}

TEST_CASE("A prismatic joint slides along its axis between its limits") {
  World world(world_of(jointed("prismatic", "0 1 0")), {});
  const double direction = GENERATE(1.0, -1.0);
  for (int i = 0; i < 120; ++i) {
    world.add_wrench(0, Wrench(0.1, direction, 0.1, 0, 0, 0.05));
    world.step(kStep, {});
  }
  const Vector3 moved = world.X_WB(0).p - Vector3(0.1, 0, 0);
  CHECK(moved.y() == Approx(direction > 0 ? 0.7 : -0.2).margin(0.02));
  CHECK(std::hypot(moved.x(), moved.z()) < 1e-3);
}

TEST_CASE("On a ball joint a body swings every way, its point stays, and it turns about itself") {
  // 0.5 m below the joint at first; pushed to the side and turned about the vertical.
  World world(world_of("<model name='lamp'><link name='a'><pose>0 0 1 0 0 0</pose>" + kInertial +
                           "</link><joint name='j' type='ball'><pose>0 0 0.5 0 0 0</pose>"
                           "<parent>world</parent><child>a</child></joint></model>",
                       kEarth),
              {});
  Twist V = Twist::Zero();
  V << 0.5, 0.3, 0, 0, 0, 2;
  V.segment<3>(3) += Vector3(0, 0, -0.5).cross(V.head<3>()) / 0.25;
  world.set_velocity(0, V);
  double farthest = 0;
  for (int i = 0; i < 120; ++i) {
    world.step(kStep, {});
    const Vector3 joint = world.X_WB(0) * Vector3(0, 0, 0.5);
    CHECK((joint - Vector3(0, 0, 1.5)).norm() < 2e-3);
    farthest = std::max(farthest, world.X_WB(0).p.head<2>().norm());
  }
  // v = sqrt(0.34) m/s lifts a pendulum of 0.5 m by v²/2g: to 0.131 m beside the vertical.
  CHECK(farthest == Approx(0.131).margin(0.01));
  CHECK(world.V_WB(0).tail<3>().norm() > 1.5);
}

TEST_CASE("A fixed joint holds a body at another") {
  World world(world_of("<model name='m'><link name='a'>" + kInertial +
                       "</link><link name='b'><pose>0.1 0 0 0 0 0</pose>" + kInertial +
                       "</link><joint name='j' type='fixed'><parent>a</parent><child>b</child>"
                       "</joint></model>"),
              {});
  for (int i = 0; i < 60; ++i) {
    world.add_wrench(0, Wrench(1, 0, 0, 0, 0, 0.01));
    world.step(kStep, {});
  }
  const Pose X_AB = world.X_WB(0).inverse() * world.X_WB(1);
  CHECK((X_AB.p - Vector3(0.1, 0, 0)).norm() < 1e-3);
}

TEST_CASE("A planar body neither leaves its plane nor tilts") {
  World world(world_of(model("m", "0 0 0.3 0 0 0", "")), {});
  world.keep_planar(0);
  for (int i = 0; i < 60; ++i) {
    world.add_wrench(0, Wrench(1, 0, 5, 0.1, -0.1, 0.001));
    world.step(kStep, {});
  }
  const Pose X_WB = world.X_WB(0);
  CHECK(X_WB.p.z() == Approx(0.3).margin(1e-4));
  CHECK((X_WB.R * Vector3::UnitZ() - Vector3::UnitZ()).norm() < 1e-3);
  CHECK(X_WB.p.x() > 0.4);
  CHECK(rotation_vector(X_WB.R).z() > 0.4);
}

TEST_CASE("The velocity of a body's point includes its rotation") {
  World world(world_of(model("m", "1 0 0 0 0 0", "")), {});
  Twist V;
  V << 0.1, 0.2, 0.3, 0, 0, 2;
  world.set_velocity(0, V);
  CHECK(world.velocity_at(0, {1.5, 0, 0}).isApprox(Vector3(0.1, 1.2, 0.3), 1e-12));
}

TEST_CASE("Two equal worlds stay equal bit for bit, whatever is stepped between them") {
  const WorldDescription description = test::repository_world("playground.sdf");
  World first(description, std::vector<int>{1});
  World second(description, std::vector<int>{1});
  World disturbance(description, {});
  run(first, 1);
  for (int i = 0; i < 60; ++i) {
    second.step(kStep, {});
    disturbance.step(kStep, {});
  }
  for (int body = 0; body < static_cast<int>(description.bodies.size()); ++body) {
    CAPTURE(description.bodies[static_cast<std::size_t>(body)].name);
    CHECK(first.X_WB(body) == second.X_WB(body));
    CHECK(first.V_WB(body) == second.V_WB(body));
  }
}

TEST_CASE("The objects of the shipped worlds stay where their files put them", "[optimised]") {
  const auto [file, tool] = GENERATE(table<std::string, std::string>({{"playground.sdf", "peg"},
                                                                      {"push.sdf", "pusher"},
                                                                      {"lift.sdf", "fork"},
                                                                      {"stack.sdf", "finger"},
                                                                      {"door.sdf", "finger"}}));
  CAPTURE(file);
  const WorldDescription description = test::repository_world(file);
  World world(description, assemble_tool(description, tool).bodies);
  run(world, 2);
  for (int body = 0; body < static_cast<int>(description.bodies.size()); ++body) {
    const BodyDescription& initial = description.bodies[static_cast<std::size_t>(body)];
    CAPTURE(initial.name);
    CHECK((world.X_WB(body).p - initial.X_WB.p).norm() < 1e-3);
  }
}

/// A body of this mass (kg) with the inertia of a cube of 50 mm, and friction 0.5.
std::string cube(const std::string& name, const std::string& pose, double mass) {
  const std::string moment = std::to_string(mass * 0.05 * 0.05 / 6);
  return "<model name='" + name + "'><pose>" + pose + "</pose><link name='body'><inertial><mass>" +
         std::to_string(mass) + "</mass><inertia><ixx>" + moment + "</ixx><iyy>" + moment +
         "</iyy><izz>" + moment +
         "</izz></inertia></inertial><collision name='c'><geometry><box><size>0.05 0.05 0.05"
         "</size></box></geometry><surface><friction><ode><mu>0.5</mu></ode></friction></surface>"
         "</collision></link></model>";
}

const std::string kTable = fixed_model("table", "0 0 0 0 0 0",
                                       "<collision name='c'><geometry><plane><normal>0 0 1</normal>"
                                       "</plane></geometry></collision>");

TEST_CASE("Six stacked cubes stand for a minute within a millimetre, each with its load",
          "[optimised]") {
  const double rate = GENERATE(30.0, 60.0);
  constexpr int kCubes = 6;
  std::string models = kTable;
  for (int i = 0; i < kCubes; ++i) {
    models +=
        cube("cube" + std::to_string(i), "0 0 " + std::to_string(0.025 + 0.05 * i) + " 0 0 0", 0.3);
  }
  World world(world_of(models, kEarth), {});
  double farthest = 0;
  for (int frame = 0; frame < 60 * rate; ++frame) {
    world.step(1 / rate, {});
    for (int i = 0; i < kCubes; ++i) {
      farthest = std::max(farthest, (world.X_WB(1 + i).p - Vector3(0, 0, 0.025 + 0.05 * i)).norm());
    }
  }
  CHECK(farthest < 1e-3);
  for (int i = 0; i < kCubes; ++i) {
    CHECK(world.loads().load(i, i + 1) == Approx((kCubes - i) * 0.3 * 9.81).epsilon(0.01));
  }
}

TEST_CASE("A wrench holds for the whole step: a free body gains its momentum exactly") {
  World world(world_of(model("m", "0 0 0 0 0 0", "")), {});
  const double rate = GENERATE(30.0, 47.0, 60.0);
  Vector6 given = Vector6::Zero();
  for (int i = 0; i < 60; ++i) {
    const Wrench F = i % 7 == 0 ? Wrench(1, -2, 3, 0.01, 0, -0.02) : Wrench(0, 0.1, 0, 0, 0.01, 0);
    world.add_wrench(0, F);
    world.step(1 / rate, {});
    given += F / rate;
  }
  Vector6 gained = world.V_WB(0);
  gained.tail<3>() *= 1e-3;
  CHECK((gained - given).norm() < 1e-9);
}

TEST_CASE("A body slides at its friction in every direction, and rests below it") {
  const double direction = GENERATE(0.0, 0.4, 0.785, 1.3);
  CAPTURE(direction);
  constexpr double kWeight = 0.3 * 9.81;
  const auto pushed = [&](double force) {
    World world(world_of(kTable + cube("cube", "0 0 0.025 0 0 0.2", 0.3), kEarth), {});
    run(world, 0.2);
    for (int i = 0; i < 60; ++i) {
      // Low, so that it does not tip over.
      const double height = 0.005 - world.X_WB(1).p.z();
      const Vector3 f(force * std::cos(direction), force * std::sin(direction), 0);
      world.add_wrench(1, (Wrench() << f, Vector3(0, 0, height).cross(f)).finished());
      world.step(kStep, {});
    }
    return world.X_WB(1).p.head<2>().norm();
  };
  CHECK(pushed(0.97 * 0.5 * kWeight) < 1e-3);
  // a = 0.1 μ g = 0.49 m/s²: 0.245 m in 1 s.
  CHECK(pushed(1.1 * 0.5 * kWeight) == Approx(0.245).epsilon(0.05));
}

TEST_CASE("A world in which only the tool moves is stepped once a frame, <physics> decides") {
  const std::string wall = fixed_model("wall", "0 0 0 0 0 0", test::box("1 1 1"));
  const std::string tool = model("tool", "2 0 0 0 0 0", "");
  CHECK(World(world_of(wall + tool), std::vector<int>{1}).substeps(kStep) == 1);
  CHECK(World(world_of(wall + tool), {}).substeps(kStep) == 16);
  const std::string physics = "<physics type='ode'><max_step_size>0.005</max_step_size></physics>";
  CHECK(World(world_of(physics + wall + tool), std::vector<int>{1}).substeps(kStep) == 4);
}

TEST_CASE("A body that goes where no body goes freezes the world, which says which body") {
  World world(
      world_of(model("brick", "0 0 0 0 0 0", "") + model("other", "1 0 0 0 0 0", ""), kEarth), {});
  const Wrench F =
      GENERATE(Wrench(1e6, 0, 0, 0, 0, 0), Wrench(0, 0, 0, 0, 1e4, 0), Wrench(0, NAN, 0, 0, 0, 0));
  run(world, 0.1);
  CHECK_FALSE(world.fault());
  world.add_wrench(0, F);
  world.step(kStep, {});
  REQUIRE(world.fault());
  CHECK_THAT(*world.fault(), Catch::Matchers::ContainsSubstring("body 'brick::body' "));
  const Pose X_WB = world.X_WB(1);
  run(world, 0.1);
  CHECK(world.X_WB(1) == X_WB);
}

TEST_CASE("A body that falls out of the world is left behind, and the others go on") {
  World world(world_of(model("stone", "0 0 0 0 0 0", "") +
                           model("balloon", "1 0 0 0 0 0", "<gravity>false</gravity>"),
                       kEarth),
              {});
  run(world, 10);
  CHECK_FALSE(world.fault());
  CHECK(world.X_WB(0).p.z() == Approx(-100).margin(2));
  world.add_wrench(1, Wrench(1, 0, 0, 0, 0, 0));
  run(world, 0.1);
  CHECK(world.V_WB(1).x() > 0);
}

TEST_CASE("A door's spring turns it to its rest, with the period of its inertia") {
  // 1 kg and 1e-3 kg·m², 0.1 m from the hinge: 0.011 kg·m².
  World world(
      world_of("<model name='door'><link name='leaf'><pose>0.1 0 0 0 0 0</pose>" + kInertial +
               "</link><joint name='hinge' type='revolute'><pose>-0.1 0 0 0 0 0</pose>"
               "<parent>world</parent><child>leaf</child><axis><xyz>0 0 1</xyz><dynamics>"
               "<spring_stiffness>0.5</spring_stiffness><spring_reference>0.4"
               "</spring_reference></dynamics></axis></joint></model>"),
      {});
  const double period = 2 * M_PI * std::sqrt(0.011 / 0.5);
  run(world, period / 2);
  CHECK(world.joints().position(0) == Approx(0.8).margin(0.02));
  run(world, period / 2);
  CHECK(world.joints().position(0) == Approx(0).margin(0.02));
}

TEST_CASE("A damped joint goes as fast as its load drives it, however much it is damped") {
  const auto damped = [](const std::string& type, const std::string& axis, double damping) {
    return world_of("<model name='m'><link name='base'>" + kInertial +
                        "</link><link name='part'><pose>0.1 0 0 0 0 0</pose>" + kInertial +
                        "</link><joint name='weld' type='fixed'><parent>world</parent>"
                        "<child>base</child></joint><joint name='j' type='" +
                        type +
                        "'><pose>-0.1 0 0 0 0 0</pose><parent>base</parent>"
                        "<child>part</child><axis><xyz>" +
                        axis + "</xyz><dynamics><damping>" + std::to_string(damping) +
                        "</damping></dynamics></axis></joint></model>",
                    kEarth);
  };
  // Semi-implicit steps could take 960 N·s/m and 10.6 N·m·s/rad. The weight is 9.81 N, 0.1 m out.
  for (const double damping : {100.0, 2000.0, 1e6}) {
    CAPTURE(damping);
    World slide(damped("prismatic", "0 0 1", damping), {});
    run(slide, 1);
    CHECK(slide.joints().velocity(1) == Approx(-9.81 / damping).epsilon(0.01));
    World hinge(damped("revolute", "0 1 0", damping), {});
    run(hinge, 0.5);
    const double arm = 0.1 * std::cos(hinge.joints().position(1));
    CHECK(hinge.joints().velocity(1) == Approx(9.81 * arm / damping).epsilon(0.01).margin(2e-4));
    CHECK(hinge.mobility_of(1).A_W.norm() < 2);  // 89 without damping.
    // A push is taken up within a step, and told as no more than that.
    slide.set_velocity(1, (Twist() << 0, 0, 1, 0, 0, 0).finished());
    CHECK(slide.mobility_of(1).A_W.norm() < 1.1 / slide.longest_step());
    run(slide, 0.1);
    CHECK(std::abs(slide.joints().velocity(1)) < 0.1);
  }
}

TEST_CASE("Worlds of two threads do not disturb each other: both as if alone, bit for bit") {
  const auto fall = [] {
    const WorldDescription description =
        test::world_of(test::fixed_model("floor", "0 0 -0.5 0 0 0", test::box("2 2 1")) +
                           test::model("lower", "0 0 0.3 0.2 0.1 0", test::box("0.2 0.2 0.2")) +
                           test::model("upper", "0.03 0 0.6 0 0.3 0", test::box("0.2 0.2 0.2")),
                       "0 0 -9.81");
    World world(description, {});
    for (int i = 0; i < 400; ++i) world.step(0.005, {});
    return world.X_WB(2);
  };
  const Pose alone = fall();
  Pose first;
  Pose second;
  {
    const std::jthread one([&] { first = fall(); });
    const std::jthread other([&] { second = fall(); });
  }
  CHECK(first == alone);
  CHECK(second == alone);
}

}  // namespace
}  // namespace hlm::ve
