#include "hlm/ve_client/world/joint_limits.h"

#include <cmath>
#include <limits>

namespace hlm::ve {
namespace {

/// Lever of a limit where the centre of mass is nearer to the axis, m.
constexpr double kArm = 0.1;
constexpr double kLeastArm = 0.01;
/// Not a shape: limits have features of their own.
constexpr std::uint32_t kNoShape = std::numeric_limits<std::uint32_t>::max();

/// A point of the child, and how it moves as the joint does.
struct Lever {
  Vector3 p_W;        ///< m.
  Vector3 along_W;    ///< Unit, for a growing position of the joint.
  double length = 1;  ///< m for each unit of the position.
};

Lever lever_of(const World& world, const JointDescription& joint) {
  const Pose X_WC = world.X_WB(joint.child);
  const BodyDescription& child = world.description().bodies[static_cast<std::size_t>(joint.child)];
  const Pose X_WJ = X_WC * child.X_WB.inverse() * joint.X_WJ;
  const Vector3 axis = X_WJ.R * joint.axis_J;
  if (joint.type == BodyJoint::kPrismatic) return {X_WC.p, axis};
  Vector3 arm = X_WC.p - X_WJ.p;
  arm -= arm.dot(axis) * axis;
  // Fixed in the child, so that the contact is the same from frame to frame.
  if (arm.norm() < kLeastArm) arm = kArm * (X_WJ.R * joint.axis_J.unitOrthogonal());
  return {X_WJ.p + arm, axis.cross(arm.normalized()), arm.norm()};
}

}  // namespace

void find_limits(const World& world, int index, double epsilon, std::vector<FoundContact>& found) {
  const JointDescription& joint = world.description().joints[static_cast<std::size_t>(index)];
  if (!joint.limited()) return;
  const Lever lever = lever_of(world, joint);
  const double position = world.joints().position(index);
  for (const bool upper : {false, true}) {
    const double gap = upper ? joint.upper - position : position - joint.lower;
    const double separation = lever.length * gap;
    if (!(separation <= epsilon)) continue;
    const Feature stop{FeatureKind::kVertex, kNoShape,
                       static_cast<std::uint16_t>(2 * index + (upper ? 1 : 0))};
    FoundContact& contact = found.emplace_back();
    contact.key = {
        {SideKind::kMovableBody, static_cast<std::uint32_t>(joint.child)},
        stop,
        {SideKind::kWorld, joint.parent < 0 ? kNoBody : static_cast<std::uint32_t>(joint.parent)},
        stop};
    contact.n_W = upper ? Vector3(-lever.along_W) : lever.along_W;
    contact.separation = separation;
    contact.p_WC = lever.p_W - separation * contact.n_W;
    contact.v_WC =
        joint.parent < 0 ? Vector3::Zero() : world.velocity_at(joint.parent, contact.p_WC);
    contact.friction = 0;
    contact.load = gap <= 0 ? world.joints().limit_force(index) / lever.length : 0;
  }
}

FoundContact reversed(const FoundContact& contact, const World& world) {
  FoundContact result = contact;
  result.key = {{SideKind::kMovableBody, contact.key.b.index},
                contact.key.b_feature,
                {SideKind::kWorld, contact.key.a.index},
                contact.key.a_feature};
  result.p_WC = contact.p_WC + contact.separation * contact.n_W;
  result.n_W = -contact.n_W;
  result.v_WC = world.velocity_at(static_cast<int>(contact.key.a.index), result.p_WC);
  return result;
}

}  // namespace hlm::ve
