// The controllers (docs/method.md 6).
#include "hlm/haptic_server/control/controller.h"

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

DeviceState device_at(const Vector3& p, const Wrench& F_hand) {
  DeviceState device;
  device.X_WD.p = p;
  device.F_hand = F_hand;
  return device;
}

Wrench wrench(double fx, double tz = 0) {
  Wrench F = Wrench::Zero();
  F[0] = fx;
  F[5] = tz;
  return F;
}

ContactWrench contact(const Wrench& F) {
  ContactWrench felt;
  felt.F = F;
  return felt;
}

TEST_CASE("Four channels pull device and proxy together and pass wrenches both ways") {
  const Controller controller(ControllerKind::kFourChannel, {});
  const DeviceState device = device_at({0.01, 0, 0}, wrench(2));
  // K_c e = 1500 N/m · 10 mm = 15 N on the proxy towards the device, and back on the device.
  CHECK(controller.to_proxy(device, {}).F[0] == Approx(15 + 2));
  CHECK(controller.to_device(device, {}, {}, contact(wrench(-4)))[0] == Approx(-15 - 4));
}

TEST_CASE("Each kind leaves out its channels") {
  const DeviceState device = device_at({0.01, 0, 0}, wrench(2));
  const Controller three(ControllerKind::kThreeChannel, {});
  CHECK(three.to_proxy(device, {}).F[0] == Approx(15));
  CHECK(three.to_device(device, {}, {}, contact(wrench(-4)))[0] == Approx(-19));
  const Controller coupler(ControllerKind::kVirtualCoupler, {});
  CHECK(coupler.to_proxy(device, {}).F[0] == Approx(15));
  CHECK(coupler.to_device(device, {}, {}, contact(wrench(-4)))[0] == Approx(-15));
  const Controller direct(ControllerKind::kDirect, {});
  CHECK(direct.to_device(device, {}, {}, contact(wrench(-4)))[0] == Approx(-4));
}

TEST_CASE("Rotations are coordinated by torque, velocities by damping") {
  const Controller controller(ControllerKind::kVirtualCoupler, {});
  DeviceState device;
  device.X_WD.R = rotation_from_vector({0, 0, 0.2});
  CHECK(controller.to_proxy(device, {}).F[5] == Approx(0.2));  // 1 N·m/rad
  HandMotion proxy;
  proxy.V_WH[0] = 0.1;                                       // m/s
  CHECK(controller.to_proxy({}, proxy).F[0] == Approx(-3));  // 30 N·s/m
}

TEST_CASE("Without a measured hand wrench four channels work as three") {
  const Controller controller(ControllerKind::kFourChannel, {});
  const DeviceState device;
  CHECK(controller.to_proxy(device, {}).F.norm() == 0);
}

TEST_CASE("Couplings to the engine pull towards its tool, whatever the local contacts say") {
  DeviceState device = device_at({0.01, 0, 0}, wrench(2));
  device.X_WD.R = rotation_from_vector({0, 0, 0.2});
  HandMotion tool;
  tool.X_WH.p = {0.008, 0, 0};
  for (const auto kind : {ControllerKind::kEngineCoupler, ControllerKind::kEngineForce}) {
    const Wrench u = Controller(kind, {}).to_device(device, {}, tool, contact(wrench(-4, 1)));
    CHECK(u[0] == Approx(-3));    // 1500 N/m · 2 mm
    CHECK(u[5] == Approx(-0.2));  // 1 N·m/rad
  }
  const Wrench u = Controller(ControllerKind::kRotationCoupler, {})
                       .to_device(device, {}, tool, contact(wrench(-4, 1)));
  CHECK(u[0] == Approx(-4));  // the contacts' force, not their torque
  CHECK(u[5] == Approx(-0.2));
}

TEST_CASE("Directly coupled, a one-joint tool is where the device is") {
  test::Random random;
  const JointType joint =
      GENERATE(JointType::kFree, JointType::kPlanar, JointType::kPrismatic, JointType::kRevolute);
  ToolDescription description = test::random_tool(random, 1, joint);
  description.X_LH.p.setZero();
  description.X_LH.R.setIdentity();
  ToolModel tool(description);
  const Configuration q = test::random_configuration(random, tool);
  const Velocity v = test::random_velocity(random, tool.dof(), 1.0);
  tool.set_configuration(q);
  const auto at = tool_at_hand(tool, tool.X_WH(), tool.hand_jacobian() * v);
  REQUIRE(at);
  CHECK((at->v - v).norm() < 1e-9);
  ToolModel placed(description);
  placed.set_configuration(at->q);
  CHECK(displacement(placed.X_WH(), tool.X_WH()).norm() < 1e-9);
}

TEST_CASE("A linkage cannot be coupled directly") {
  test::Random random;
  ToolModel tool(test::random_tool(random, 3, JointType::kFree));
  CHECK_FALSE(tool_at_hand(tool, {}, Twist::Zero()));
}

TEST_CASE("The start-up check names what the device cannot render") {
  DeviceRatings device;
  device.max_stiffness = 1000;
  device.damping = 5;
  const auto doubts =
      check_against_device(ControllerKind::kFourChannel, {}, {}, device, false, 1e-3);
  REQUIRE(doubts.size() == 2);
  CHECK_THAT(doubts[0], ContainsSubstring("works as three_channel"));
  CHECK_THAT(doubts[1], ContainsSubstring("1500 N/m is above the device's rated 1000 N/m"));

  LocalModelParameters stiff;
  stiff.stiffness = 15'000;
  stiff.damping = 0;
  const auto colgate = check_against_device(ControllerKind::kDirect, {}, stiff, device, true, 1e-3);
  REQUIRE(colgate.size() == 1);
  CHECK_THAT(colgate[0], ContainsSubstring("needs 7.5 N·s/m"));  // kΔt/2
}

TEST_CASE("A gain out of range is named") {
  ControllerGains gains;
  gains.damping = -1;
  CHECK_THAT(find_error(gains).value(), ContainsSubstring("coupling damping -1"));
}

}  // namespace
}  // namespace hlm::server
