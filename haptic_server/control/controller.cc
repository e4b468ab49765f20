#include "hlm/haptic_server/control/controller.h"

#include <algorithm>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// Coordinates of the tool's one moving joint for X_JL, the pose of its link in its frame.
Configuration joint_coordinates(const Link& link, const Pose& X_JL) noexcept {
  const Vector3 r = rotation_vector(X_JL.R);
  switch (link.joint) {
    case JointType::kFixed:
      return Configuration(0);
    case JointType::kRevolute:
      return Configuration::Constant(1, link.axis.dot(r));
    case JointType::kPrismatic:
      return Configuration::Constant(1, link.axis.dot(X_JL.p));
    case JointType::kPlanar:
      return Configuration(Vector3(X_JL.p.x(), X_JL.p.y(), r.z()));
    case JointType::kFree: {
      Configuration q(7);
      q << X_JL.p, X_JL.R.w(), X_JL.R.vec();
      return q;
    }
    case JointType::kGuided:
    case JointType::kFollowing:
      break;
  }
  return Configuration(0);
}

}  // namespace

Controller::Controller(ControllerKind kind, const ControllerGains& gains) noexcept
    : kind_(kind),
      stiffness_(diagonal(gains.stiffness, gains.angular_stiffness)),
      damping_(diagonal(gains.damping, gains.angular_damping)) {}

Wrench Controller::coordination(const DeviceState& device,
                                const HandMotion& partner) const noexcept {
  return stiffness_.cwiseProduct(displacement(partner.X_WH, device.X_WD)) +
         damping_.cwiseProduct(device.V_WD - partner.V_WH);
}

HandInput Controller::to_proxy(const DeviceState& device, const HandMotion& proxy) const noexcept {
  if (traits(kind_).replaces_proxy) return {};
  HandInput input{coordination(device, proxy), stiffness_, damping_};
  if (passes_hand_wrench(device)) input.F += *device.F_hand;
  return input;
}

Wrench Controller::to_device(const DeviceState& device, const HandMotion& proxy,
                             const HandMotion& engine_tool,
                             const ContactWrench& felt) const noexcept {
  switch (kind_) {
    case ControllerKind::kFourChannel:
    case ControllerKind::kThreeChannel: {
      // A proxy that the hand's wrench does not hold hangs from the coupling with its weight.
      const Wrench F_env = passes_hand_wrench(device) ? felt.F : Wrench(felt.F - felt.weight);
      return F_env - coordination(device, proxy);
    }
    case ControllerKind::kVirtualCoupler:
      return -coordination(device, proxy);
    case ControllerKind::kDirect:
      return felt.F;
    // The environment's tool is weightless: it only follows.
    case ControllerKind::kRotationCoupler: {
      Wrench u = felt.weight - coordination(device, engine_tool);
      u.head<3>() = felt.F.head<3>();
      return u;
    }
    case ControllerKind::kEngineCoupler:
    case ControllerKind::kEngineForce:
      return felt.weight - coordination(device, engine_tool);
  }
  return Wrench::Zero();
}

std::optional<ToolAtHand> tool_at_hand(const ToolModel& tool, const Pose& X_WH,
                                       const Twist& V_WH) noexcept {
  const ToolDescription& description = tool.description();
  const Link& root = description.links[0];
  if (description.links.size() != 1) return std::nullopt;
  const Pose X_WL = X_WH * description.X_LH.inverse();
  ToolAtHand at{joint_coordinates(root, root.X_PJ.inverse() * X_WL), Velocity(tool.dof())};
  const Jacobian J_h = tool.hand_jacobian();
  const MassMatrix normal = J_h.transpose() * J_h;
  at.v = normal.llt().solve(J_h.transpose() * V_WH);
  return at;
}

std::optional<std::string> find_error(const ControllerGains& gains) {
  return find_error(gains, kGainNumbers);
}

}  // namespace hlm::server
