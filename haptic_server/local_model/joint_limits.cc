#include "hlm/haptic_server/local_model/joint_limits.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// A shorter lever is taken as the tool's length: a stop close to its axis would be soft. m.
constexpr double kLeastLever = 0.01;

}  // namespace

JointLimits::JointLimits(const ToolDescription& tool, const Configuration& q) noexcept {
  int coordinate = 0;
  for (int i = 0; i < static_cast<int>(tool.links.size()); ++i) {
    const Link& link = tool.links[static_cast<std::size_t>(i)];
    Limit limit = limit_of(link, tool.length);
    limit.link = i;
    limit.coordinate = coordinate;
    const auto add = [&](double bound, double sign) {
      limit.bound = bound;
      limit.sign = sign;
      limits_.push_back(limit);
      contacts_.push_back(contact_at(limit, link.parent));
      contacts_.back().identity = limits_.size();
    };
    if (has_axis(link.joint) && link.lower > -kNoLimit) add(std::min(link.lower, q[coordinate]), 1);
    if (has_axis(link.joint) && link.upper < kNoLimit) add(std::max(link.upper, q[coordinate]), -1);
    coordinate += joint_configuration_size(link.joint);
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
