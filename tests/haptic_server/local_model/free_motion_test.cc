// Tools left to themselves: what moves without force keeps its energy and its momentum, and moves
// as in MuJoCo (docs/method.md 1).
#include "hlm/haptic_server/local_model/free_motion.h"

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/mujoco_tool.h"

namespace hlm::server {
namespace {

using test::Random;

constexpr double kStep = 1e-3;  // s

double kinetic_energy(const ToolModel& tool, const Velocity& v) {
  return 0.5 * v.dot(tool.mass_matrix() * v);
}

/// A tool, weightless unless it says otherwise, in a random posture.
struct Moving {
  ToolModel tool;
  Velocity v;
};

/// A random velocity of the given kinetic energy (J).
Moving random_motion(Random& random, ToolDescription description, double energy) {
  description.gravity_W.setZero();
  Moving moving{ToolModel(description), {}};
  moving.tool.set_configuration(test::random_configuration(random, moving.tool));
  moving.v = test::random_velocity(random, moving.tool.dof(), 1);
  moving.v *= std::sqrt(energy / kinetic_energy(moving.tool, moving.v));
  return moving;
}

/// The proxy of the local model, moving alike.
LocalModel proxy_of(const Moving& moving) {
  const Configuration& q = moving.tool.configuration();
  LocalModel model(moving.tool.description(), q, {}, kStep);
  model.follow(q, moving.v);
  return model;
}

/// The paper's rigid tool would be no test: unequal moments of inertia, origin beside the centre of
/// mass.
ToolDescription lopsided_tool() {
  ToolDescription tool =
      test::rigid_tool(0.3, Vector3(1e-4, 3e-4, 3.5e-4).asDiagonal().toDenseMatrix());
  tool.links[0].p_LCom = {0.02, -0.01, 0.03};
  return tool;
}

TEST_CASE("The proxy of a free linkage keeps its energy within 1 % over 60 s", "[optimised]") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute);
  const auto [links, energy] = GENERATE(std::pair(2, 0.5), std::pair(7, 5.0));  // J
  const Moving start = random_motion(random, test::random_chain(random, links, root), energy);
  LocalModel model = proxy_of(start);
  double largest = energy;
  double smallest = energy;
  for (int i = 0; i < 60'000; ++i) {
    model.step({});
    const double present = kinetic_energy(model.proxy(), model.velocity());
    largest = std::max(largest, present);
    smallest = std::min(smallest, present);
  }
  CHECK(largest < 1.01 * energy);
  CHECK(smallest > 0.99 * energy);
}

TEST_CASE("The proxy of a free tool moves as in MuJoCo for 1 s, to 1e-3 rad and 1 mm",
          "[optimised]") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute);
  const auto [links, energy] =
      GENERATE(std::pair(1, 0.5), std::pair(2, 0.5), std::pair(7, 5.0));  // J
  const ToolDescription tool = links == 1 && root == JointType::kFree
                                   ? lopsided_tool()
                                   : test::random_chain(random, links, root);
  const Moving start = random_motion(random, tool, energy);
  LocalModel model = proxy_of(start);
  test::MujocoTool reference(start.tool.description());
  for (int i = 0; i < 1000; ++i) model.step({});
  const Configuration expected = reference.move(start.tool.configuration(), start.v, 1);
  CAPTURE(model.proxy().configuration().transpose(), expected.transpose());
  CHECK((model.proxy().configuration() - expected).cwiseAbs().maxCoeff() < 1e-3);
  // A step that only held the velocity would not pass.
  const ToolModel& proxy = model.proxy();
  const Configuration straight = proxy.integrate(start.tool.configuration(), start.v, 1);
  if (links > 1) CHECK((expected - straight).norm() > 5e-3);
}

TEST_CASE("Half the step leaves a sixteenth of the error") {
  Random random;
  const int links = GENERATE(1, 2, 7);
  const ToolDescription tool =
      links == 1 ? lopsided_tool() : test::random_chain(random, links, JointType::kFree);
  const Moving start = random_motion(random, tool, links);
  const auto moved = [&](int steps) {
    Moving moving = start;
    for (int i = 0; i < steps; ++i) move_freely(moving.tool, moving.v, 0.1 / steps);  // s
    return moving.tool.configuration();
  };
  const Configuration exact = moved(400);
  const double coarse = (moved(10) - exact).norm();
  const double fine = (moved(20) - exact).norm();
  CAPTURE(links, coarse * 1e9, fine * 1e9);
  CHECK(coarse / fine > 13);
}

TEST_CASE("A spinning tool of unequal moments of inertia keeps momentum and energy over 60 s",
          "[optimised]") {
  Random random;
  const double energy = 0.1;  // J, some 25 rad/s
  const Moving start = random_motion(random, lopsided_tool(), energy);
  const auto momentum = [](const ToolModel& tool, const Velocity& v) {
    // About the world's origin: that about the link's, which D gives, and the lever arm's.
    const Velocity p = tool.mass_matrix() * v;
    Vector6 sum;
    sum << p.head<3>(), p.tail<3>() + tool.X_WL(0).p.cross(Vector3(p.head<3>()));
    return sum;
  };
  LocalModel model = proxy_of(start);
  for (int i = 0; i < 60'000; ++i) model.step({});
  const Vector6 before = momentum(start.tool, start.v);
  const Vector6 change = momentum(model.proxy(), model.velocity()) - before;
  CHECK(change.head<3>().norm() < 1e-9 * before.head<3>().norm());
  CHECK(change.tail<3>().norm() < 1e-9 * before.tail<3>().norm());
  CHECK(kinetic_energy(model.proxy(), model.velocity()) == Approx(energy).epsilon(1e-6));
}

TEST_CASE("A double pendulum keeps kinetic and potential energy together within 1 % for 10 s",
          "[optimised]") {
  ToolDescription tool;
  for (int i = 0; i < 2; ++i) {
    Link link;
    link.parent = i - 1;
    link.joint = JointType::kRevolute;
    link.axis = Vector3::UnitY();
    if (i > 0) link.X_PJ.p = {0.2, 0, 0};
    link.p_LCom = {0.1, 0, 0};
    link.mass = 0.4;
    link.I_LCom = 1.4e-3 * Matrix3::Identity();
    tool.links.push_back(link);
  }
  tool.hand_link = 1;
  tool.gravity_W = {0, 0, -9.81};
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  const auto energy = [&] {
    double sum = kinetic_energy(model.proxy(), model.velocity());
    for (int i = 0; i < 2; ++i) {
      const Link& link = tool.links[static_cast<std::size_t>(i)];
      sum += link.mass * 9.81 * (model.proxy().X_WL(i) * link.p_LCom).z();
    }
    return sum;
  };
  // From the horizontal, where it is 0, to the lowest point: 0.4·9.81·(0.1 + 0.3) J.
  const double fall = 1.57;
  for (int i = 0; i < 10'000; ++i) {
    model.step({});
    REQUIRE(std::abs(energy()) < 0.01 * fall);
  }
}

}  // namespace
}  // namespace hlm::server
