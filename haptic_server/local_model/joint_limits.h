// The limits of the tool's joints, as contacts: a joint at its stop is held, stopped and felt by
// the same law as a link at a wall (docs/method.md 4.6).
#pragma once

#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/local_model/local_contact.h"

namespace hlm::server {

/// One contact for each limit of each joint, between the link that the joint moves and its parent.
/// It acts on the joint's coordinate alone: a prismatic joint's along its axis, a revolute joint's
/// across the lever from the axis to the link's far end, so that s = lever · (limit - q) however
/// far the joint turns. Without friction.
class JointLimits {
 public:
  /// A limit that q, the initial configuration, exceeds is at q instead: nothing is thrown back.
  JointLimits(const ToolDescription& tool, const Configuration& q) noexcept;

  /// Places the contacts for the tool's present configuration, in every step.
  void place(const ToolModel& tool) noexcept;

  LocalContacts& contacts() noexcept { return contacts_; }
  const LocalContacts& contacts() const noexcept { return contacts_; }

 private:
  struct Limit {
    int link = 0;
    int coordinate = 0;
    double bound = 0;  ///< Bound of q, rad or m.
    double sign = 1;   ///< Sign of q̇ away from the limit.
    /// The lever's end, where the contact is, from the link's origin, link frame, m.
    Vector3 p_L = Vector3::Zero();
    /// How the lever's end moves for a growing q, link frame: along a unit vector, by `lever` (m)
    /// for each unit of q.
    Vector3 along_L = Vector3::UnitZ();
    double lever = 1;
  };

  static Limit limit_of(const Link& link, double tool_length) noexcept;
  static Limit limit_of(const ToolDescription& tool, int index, double bound) noexcept;
  static LocalContact contact_at(const Limit& limit, int parent) noexcept;

  StaticVector<Limit, 2 * kMaxLinks> limits_;
  LocalContacts contacts_;  ///< Contacts in the order of limits_.
};

}  // namespace hlm::server
