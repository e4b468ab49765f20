#include "hlm/haptic_server/local_model/joint_limits.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// A shorter lever is taken as the tool's length: a stop close to its axis would be soft. m.
constexpr double kLeastLever = 0.01;
/// A guided link that goes less for each unit of its coordinate goes nowhere.
constexpr double kDeadCentre = 1e-9;

}  // namespace

JointLimits::JointLimits(const ToolDescription& tool, const Configuration& q) noexcept {
  const ToolModel model(tool);
  for (int i = 0; i < model.links(); ++i) {
    const Link& link = tool.links[static_cast<std::size_t>(i)];
    if (!has_one_coordinate(link.joint)) continue;
    const int coordinate = model.coordinate_index(i);
    const auto add = [&](double bound, double sign) {
      Limit limit = has_axis(link.joint) ? limit_of(link, tool.length) : limit_of(tool, i, bound);
      limit.link = i;
      limit.coordinate = coordinate;
      limit.bound = bound;
      limit.sign = sign;
      limits_.push_back(limit);
      contacts_.push_back(contact_at(limit, link.parent));
      contacts_.back().identity = limits_.size();
    };
    if (link.lower > -kNoLimit) add(std::min(link.lower, q[coordinate]), 1);
    if (link.upper < kNoLimit) add(std::max(link.upper, q[coordinate]), -1);
  }
}

/// Without link, coordinate, bound and sign.
JointLimits::Limit JointLimits::limit_of(const Link& link, double tool_length) noexcept {
  Limit limit;
  if (link.joint == JointType::kPrismatic) {
    limit.p_L = link.p_LCom;
    limit.along_L = link.axis;
    return limit;
  }
  // The link's origin is on the axis, its far end twice as far as its centre of mass.
  Vector3 arm = 2 * (link.p_LCom - link.axis.dot(link.p_LCom) * link.axis);
  if (arm.norm() < kLeastLever) arm = tool_length * link.axis.unitOrthogonal();
  limit.p_L = arm;
  limit.lever = arm.norm();
  limit.along_L = link.axis.cross(arm) / limit.lever;
  return limit;
}

/// The same of a guided link at its limit: at its centre of mass, or beside it where it turns more
/// than it moves.
JointLimits::Limit JointLimits::limit_of(const ToolDescription& tool, int index,
                                         double bound) noexcept {
  const Link& link = tool.links[static_cast<std::size_t>(index)];
  const auto curve = std::ranges::find(tool.curves, index, &JointCurve::link);
  const CurvePoint point = point_of(*curve, link.lower, link.upper, bound);
  const Quaternion R_LJ = point.X_JL.R.conjugate();
  const Vector3 v = R_LJ * point.v_J;
  const Vector3 omega = R_LJ * point.omega_J;
  const auto velocity = [&](const Vector3& p) -> Vector3 { return v + omega.cross(p); };
  Limit limit;
  limit.p_L = link.p_LCom;
  if (omega.norm() * tool.length > velocity(link.p_LCom).norm()) {
    const Vector3 beside = tool.length * omega.unitOrthogonal();
    const bool adds = omega.cross(beside).dot(velocity(link.p_LCom)) >= 0;
    limit.p_L += adds ? beside : Vector3(-beside);
  }
  limit.lever = std::max(velocity(limit.p_L).norm(), kDeadCentre);
  limit.along_L =
      velocity(limit.p_L) / limit.lever;  // None at a dead centre: it stops there itself.
  return limit;
}

LocalContact JointLimits::contact_at(const Limit& limit, int parent) noexcept {
  LocalContact contact;
  contact.a = {SideKind::kToolLink, static_cast<std::uint32_t>(limit.link)};
  contact.frame_a = frame_of_link(contact.a.index);
  if (parent >= 0) {
    contact.b = {SideKind::kToolLink, static_cast<std::uint32_t>(parent)};
    contact.frame_b = frame_of_link(contact.b.index);
  }
  contact.deformation.p_A = limit.p_L;
  contact.material.friction = 0;
  return contact;
}

void JointLimits::place(const ToolModel& tool) noexcept {
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const Limit& limit = limits_[i];
    LocalContact& contact = contacts_[i];
    const Pose& X_WA = tool.X_WL(limit.link);
    const Pose X_BW = contact.frame_b == kWorldFrame
                          ? Pose{}
                          : tool.X_WL(static_cast<int>(contact.b.index)).inverse();
    const double gap = limit.sign * (tool.configuration()[limit.coordinate] - limit.bound);
    const Vector3 n_W = limit.sign * (X_WA.R * limit.along_L);
    contact.constraint.n_P = X_BW.R * n_W;
    contact.constraint.c_B = X_BW * (X_WA * limit.p_L - limit.lever * gap * n_W);
  }
}

}  // namespace hlm::server
