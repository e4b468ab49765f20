// How a body hangs on another one, or on the world: what a server must know to move it there.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "hlm/common/contact.h"
#include "hlm/common/tool_description.h"

namespace hlm {

/// The parent of what hangs on the world.
inline constexpr std::uint32_t kNoBody = 0xffffffff;

/// A body has one at most, whose coordinate q is 0 where the joint's frames in both lie on each
/// other. Forces act on that coordinate: N or N·m.
struct BodyJoint {
  std::uint32_t body = 0;
  std::uint32_t parent = kNoBody;
  JointType type = JointType::kRevolute;  ///< Or kPrismatic.
  Pose X_PJ = {};                         ///< Joint's frame in the parent's, or in the world,
  Pose X_BJ = {};                         ///< and in the body's.
  Vector3 axis = Vector3::UnitZ();        ///< Of growing q, unit, in the joint's frame.
  double lower = -kNoLimit;               ///< Limits of q, rad or m.
  double upper = kNoLimit;
  double stiffness = 0;  ///< Of a spring, N/m or N·m/rad,
  double reference = 0;  ///< which is at rest at this q.
  double damping = 0;    ///< N·s/m or N·m·s/rad.
  double friction = 0;   ///< Largest dry friction, N or N·m.
  double armature = 0;   ///< Inertia of a motor in it, kg or kg·m².

  bool operator==(const BodyJoint&) const = default;
};

/// q and q̇ of a joint.
struct JointState {
  double q = 0;
  double v = 0;
};

/// The state of a joint between a body and its parent, at rest at the origin if that is the world.
/// Of an angle the one within the limits, if there is one.
inline JointState joint_state(const BodyJoint& joint, const BodyPose& parent,
                              const BodyPose& body) noexcept {
  const Pose X_WJ = parent.X_WB * joint.X_PJ;
  const Pose X_WChild = body.X_WB * joint.X_BJ;
  const Pose X_J = X_WJ.inverse() * X_WChild;
  const Vector3 axis_W = X_WJ.R * joint.axis;
  const auto velocity = [&](const BodyPose& of) {
    return Vector3(of.V_W.head<3>() + of.V_W.tail<3>().cross(X_WChild.p - of.X_WB.p));
  };
  if (joint.type == JointType::kPrismatic) {
    return {joint.axis.dot(X_J.p), axis_W.dot(velocity(body) - velocity(parent))};
  }
  constexpr double kTurn = 2 * std::numbers::pi;
  double q = 2 * std::atan2(joint.axis.dot(X_J.R.vec()), X_J.R.w());
  const bool limited = joint.lower > -kNoLimit && joint.upper < kNoLimit;
  const double middle = limited ? (joint.lower + joint.upper) / 2 : 0;
  q -= kTurn * std::round((q - middle) / kTurn);
  return {q, axis_W.dot(body.V_W.tail<3>() - parent.V_W.tail<3>())};
}

}  // namespace hlm
