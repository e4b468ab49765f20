// The tool's own weight: whoever holds the tool still bears it, all of it and once, whatever the
// controller (docs/method.md 4.4, 6.1).
#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

const Vector3 kGravity{0, -9.81, 0};  // m/s²

ServoOptions with_controller(ControllerKind kind) {
  ServoOptions options;
  options.controller = kind;
  options.limits.max_force = 50;  // N
  options.limits.max_torque = 5;  // N·m
  return options;
}

/// A hand that holds the device where the session began, for 3 s.
/// Measured: the device knows its wrench.
class HeldDevice {
 public:
  HeldDevice(ControllerKind kind, const ToolDescription& tool, const Configuration& q,
             bool measured = true)
      : bench_(with_controller(kind)) {
    bench_.say_hello(tool, q);
    bench_.tick();
    bench_.device.state->X_WD = bench_.device.aligned_to;
    for (int i = 0; i < 3000; ++i) {
      bench_.device.state->F_hand.reset();
      if (measured) bench_.device.state->F_hand = -bench_.device.written;
      i % 20 == 0 ? bench_.tick_with(bench_.update()) : bench_.tick();
    }
    bench_.tick_with(bench_.update());
  }

  /// What the hand must hold against, N and N·m.
  Wrench wrench() const { return bench_.device.written; }
  /// The proxy's configuration.
  Configuration q() const { return bench_.last_sent<protocol::ProxyState>().q; }

 private:
  test::ServoBench bench_;
};

TEST_CASE("The hand bears the full weight of a rigid tool under every controller") {
  // 0.5 kg, its centre of mass 20 mm from the hand.
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar);
  ToolDescription tool = test::rigid_tool(0.5, Matrix3::Identity() * 1e-3, root);
  tool.gravity_W = kGravity;
  tool.X_LH.p = {-0.02, 0, 0};
  for (const auto& word : kWords<ControllerKind>) {
    CAPTURE(word.name);
    const Wrench F = HeldDevice(word.value, tool, ToolModel(tool).neutral()).wrench();
    CHECK(F[1] == Approx(-4.905).epsilon(1e-3));         // N
    CHECK(std::abs(F[0]) + std::abs(F[2]) < 1e-3);       // N
    CHECK(F[5] == Approx(-4.905 * 0.02).epsilon(0.01));  // N·m
  }
}

TEST_CASE("Without a measured hand wrench four channels bear the weight once, too") {
  ToolDescription tool = test::planar_tool();
  tool.gravity_W = kGravity;
  const Wrench F =
      HeldDevice(ControllerKind::kFourChannel, tool, ToolModel(tool).neutral(), false).wrench();
  CHECK(F[1] == Approx(-9.81).epsilon(1e-3));  // N
}

TEST_CASE("The hand bears what a linkage's base does not") {
  // An upright arm of two links on a fixed shoulder, held at the forearm's end.
  ToolDescription arm;
  for (int i = 0; i < 2; ++i) {
    Link link;
    link.parent = i - 1;
    link.joint = JointType::kRevolute;
    if (i > 0) link.X_PJ.p = {0.2, 0, 0};
    link.p_LCom = {0.1, 0, 0};
    link.mass = 0.4;
    link.I_LCom = test::box_inertia(link.mass, {0.1, 0.01, 0.01});
    arm.links.push_back(link);
  }
  arm.hand_link = 1;
  arm.X_LH.p = {0.2, 0, 0};
  arm.length = 0.4;
  arm.gravity_W = kGravity;
  for (const auto kind : {ControllerKind::kFourChannel, ControllerKind::kThreeChannel,
                          ControllerKind::kVirtualCoupler}) {
    CAPTURE(name_of(kind));
    const HeldDevice held(kind, arm, Configuration(Eigen::Vector2d(0.4, 1.2)));
    ToolModel proxy(arm);
    proxy.set_configuration(held.q());
    // Statics: the hand's wrench, opposite to the device's, balances the weight in both joints.
    const GeneralisedForce by_hand = -proxy.hand_jacobian().transpose() * held.wrench();
    CHECK((by_hand - proxy.gravity()).norm() < 1e-3 * proxy.gravity().norm());  // N·m
  }
}

}  // namespace
}  // namespace hlm::server
