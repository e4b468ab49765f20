// Joints at their stops (docs/method.md 4.6).
#include "hlm/haptic_server/local_model/joint_limits.h"

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s

Link bar(JointType joint) {
  Link link;
  link.joint = joint;
  link.p_LCom = {0.1, 0, 0};
  link.mass = 0.4;
  link.I_LCom = test::box_inertia(link.mass, {0.1, 0.01, 0.01});
  return link;
}

/// A bar of 0.2 m on a hinge, held at its end, that turns between -0.5 and 2 rad.
ToolDescription flap() {
  ToolDescription tool;
  tool.links.push_back(bar(JointType::kRevolute));
  tool.links[0].lower = -0.5;
  tool.links[0].upper = 2;
  tool.X_LH.p = {0.2, 0, 0};
  tool.length = 0.2;
  return tool;
}

/// Two bars on a free root whose hinge stops at ± 0.3 rad.
ToolDescription nunchaku() {
  ToolDescription tool;
  tool.links.push_back(bar(JointType::kFree));
  tool.links.push_back(bar(JointType::kRevolute));
  tool.links[1].parent = 0;
  tool.links[1].X_PJ.p = {0.2, 0, 0};
  tool.links[1].lower = -0.3;
  tool.links[1].upper = 0.3;
  tool.hand_link = 1;
  return tool;
}

Configuration angle(double q) { return Configuration::Constant(1, q); }

TEST_CASE("A joint's contacts are as far away as its limits, however far it turns") {
  ToolDescription tool = flap();
  tool.links[0].lower = -8;  // rad: more than a whole turn
  tool.links[0].upper = 10;
  ToolModel model(tool);
  JointLimits limits(tool, model.configuration());
  REQUIRE(limits.contacts().size() == 2);
  for (const double q : {-7.9, -3.0, 0.0, 2.0, 9.9}) {
    model.set_configuration(angle(q));
    limits.place(model);
    const FrameMotions frames(model, nullptr, {}, kStep);
    evaluate_contacts(limits.contacts(), frames);
    CHECK(limits.contacts()[0].now.s == Approx(0.2 * (q + 8)));   // m, at the bar's end
    CHECK(limits.contacts()[1].now.s == Approx(0.2 * (10 - q)));  // m
  }
}

TEST_CASE("A bar that is pushed against its stop rests there, and the hand feels the push") {
  const double side = GENERATE(-1, 1);
  LocalModel model(flap(), angle(0), {}, kStep);
  ContactWrench felt;
  for (int i = 0; i < 3000; ++i) {
    HandInput hand;
    hand.F.head<3>() = model.proxy().X_WH().R * Vector3(0, side * 2, 0);  // N, across the bar
    hand.damping << Vector3::Constant(5), Vector3::Zero();
    felt = model.step(hand);
  }
  const double depth = 2 / LocalModelParameters{}.stiffness / 0.2;  // rad: as a wall at its end
  CHECK(model.proxy().configuration()[0] ==
        Approx(side > 0 ? 2 + depth : -0.5 - depth).epsilon(1e-4));
  CHECK(model.state() == ProxyContactState::kResting);
  CHECK(model.limits()[side > 0 ? 1 : 0].latest.loaded);
  // Moments about the hinge.
  const Jacobian J_h = model.proxy().hand_jacobian();
  CHECK((J_h.transpose() * felt.F)[0] == Approx(-side * 2 * 0.2).epsilon(1e-3));  // N·m
}

TEST_CASE("A bar that swings against its stop collides once and rebounds by its restitution") {
  LocalModelParameters parameters;
  parameters.restitution = GENERATE(0.0, 0.5, 1.0);
  LocalModel model(flap(), angle(1.9), parameters, kStep);
  model.follow(angle(1.9), Velocity::Constant(1, 3));
  int collisions = 0;
  for (int i = 0; i < 100; ++i) {
    model.step({});
    collisions += model.state() == ProxyContactState::kColliding;
  }
  CHECK(collisions == 1);
  // The contact's damper takes part from the step before the collision on, as at a wall.
  CHECK(model.velocity()[0] > -3 * parameters.restitution - 0.15);        // rad/s
  CHECK(model.velocity()[0] < -0.75 * 3 * parameters.restitution + 0.1);  // rad/s
}

TEST_CASE("A limit between two links acts on both: momentum stays, energy does not grow",
          "[optimised]") {
  test::Random random;
  const ToolDescription tool = nunchaku();
  ToolModel start(tool);
  Velocity v = test::random_velocity(random, tool.dof(), 0.3);
  v[6] = 4;  // rad/s
  LocalModelParameters parameters;
  parameters.restitution = 0.8;
  LocalModel model(tool, start.configuration(), parameters, kStep);
  model.follow(start.configuration(), v);
  const auto momentum = [&] {
    return Vector6((model.proxy().mass_matrix() * model.velocity()).head<6>());
  };
  const auto energy = [&] {
    return 0.5 * model.velocity().dot(model.proxy().mass_matrix() * model.velocity());
  };
  const Vector3 p = momentum().head<3>();
  double before = energy();
  int collisions = 0;
  for (int i = 0; i < 5000; ++i) {
    model.step({});
    collisions += model.state() == ProxyContactState::kColliding;
    REQUIRE(energy() < before + 1e-5);  // J: what a spring that is pressed in gives back
    before = std::max(energy(), 0.99 * before);
    REQUIRE(std::abs(model.proxy().configuration()[7]) < 0.31);  // rad
  }
  CHECK(collisions > 0);
  CHECK((momentum().head<3>() - p).norm() < 1e-6 * p.norm());
}

TEST_CASE("A slide stops at its limits, and an initial position beyond one is its limit") {
  ToolDescription tool;
  tool.links.push_back(bar(JointType::kPrismatic));
  tool.links[0].axis = Vector3::UnitX();
  tool.links[0].lower = -0.05;
  tool.links[0].upper = 0.1;
  HandInput hand;
  hand.F[0] = 2;  // N
  hand.damping << Vector3::Constant(10), Vector3::Zero();
  const double depth = 2 / LocalModelParameters{}.stiffness;  // m
  const auto rests_at = [&](double from) {
    LocalModel model(tool, angle(from), {}, kStep);
    for (int i = 0; i < 3000; ++i) model.step(hand);
    return model.proxy().configuration()[0];
  };
  CHECK(rests_at(0) == Approx(0.1 + depth).epsilon(1e-4));
  CHECK(rests_at(0.3) == Approx(0.3 + depth).epsilon(1e-4));
}

TEST_CASE("Put where the device is, a joint feels its limit too") {
  LocalModel model(flap(), angle(0), {}, kStep);
  const ContactWrench felt = model.follow(angle(2.01), Velocity::Zero(1));
  const double force = LocalModelParameters{}.stiffness * 0.2 * 0.01;  // N at the bar's end
  const Jacobian J_h = model.proxy().hand_jacobian();
  CHECK((J_h.transpose() * felt.F)[0] == Approx(-force * 0.2));  // N·m
}

}  // namespace
}  // namespace hlm::server
