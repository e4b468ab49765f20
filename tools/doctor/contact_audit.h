// Whether a client's contacts can be trusted: what changes from update to update otherwise than the
// motion says.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hlm/common/tool_model.h"
#include "hlm/protocol/messages.h"

namespace hlm::server {

/// Contacts of the tool with world and bodies, counted once in each update.
struct ContactCounts {
  std::uint64_t updates = 0;
  std::uint64_t contacts = 0;
  std::uint64_t predicted = 0;   ///< Not yet touching.
  std::uint64_t duplicates = 0;  ///< Contacts with another contact's identity in the update.
  std::uint64_t far = 0;         ///< Contacts with a point that no tool of this size has.
  std::uint64_t kept = 0;        ///< Contacts of the update before, at about the same place;
  std::uint64_t renamed = 0;     ///< contacts of the update before, under another identity.
  std::uint64_t wandered = 0;    ///< Identities that were at another place,
  std::uint64_t flipped = 0;     ///< or had a normal of the other direction.
  std::uint64_t moved = 0;       ///< Kept contacts that came nearer or went by a noticeable way;
  std::uint64_t reversed = 0;    ///< contacts whose separation said the opposite,
  std::uint64_t jumped = 0;      ///< or changed differently from what the motion says.
  double largest_jump = 0;       ///< m.
  std::uint64_t frozen = 0;      ///< Moved contacts that were sent again as they were.
  /// Sums over contacts whose motion in the updates before is known: squares of what separations
  /// change by, less the motion of so many updates earlier, m².
  std::array<double, 6> off_by_age{};
  double motion2 = 0;  ///< Of the motion, m².
  /// Of the ways along the surface, and of what separations change by beyond the motion, m²: they
  /// have to do with each other where normals are tilted.
  Matrix3 ways = Matrix3::Zero();
  Vector3 off_along = Vector3::Zero();
  double off2 = 0;
  std::uint64_t vanished = 0;  ///< Contacts left out while their place was still near.
  std::uint64_t appeared = 0;  ///< Contacts first seen in the update;
  std::uint64_t late = 0;      ///< those of them that epsilon should have shown before.
  double seen_from = 0;        ///< Largest separation of any contact, m.
};

/// Compares each update with the one before.
class ContactAudit {
 public:
  /// `tool` must be valid; epsilon as the hello has it, m.
  ContactAudit(const ToolDescription& tool, double epsilon) : tool_(tool), epsilon_(epsilon) {}

  /// Adds updates in the order of their times. After a gap nothing is compared.
  void add(const protocol::ContactUpdate& update);
  const ContactCounts& counts() const noexcept { return counts_; }

 private:
  struct Seen {
    ReportedContact contact;
    Vector3 p_A = Vector3::Zero();  ///< The tool's point, link's frame, m.
    double v_n = 0;                 ///< Velocity of that point against the constraint, m/s.
    bool goes_on = false;           ///< Is in the next update too.
    std::array<double, 5>
        motions{};              ///< Along the normal, of the updates before, the latest first,
    std::size_t moved_for = 0;  ///< as many as are known, m.
  };

  std::vector<Seen> see(const protocol::ContactUpdate& update);
  void compare(std::vector<Seen>& now, const MovableBodies& bodies, double dt);
  /// The same identity in both.
  void compare(const Seen& before, Seen& now, double dt);
  void count_errors(const Seen& before, Seen& now, const Vector3& travel);
  Vector3 tool_point(const Seen& seen) const;
  /// Seen::v_n with the body as another update has it. A body that is not in it may have been hit
  /// in between: it went the other way, as the tool sees it.
  static double v_n_with(const Seen& seen, const MovableBodies& bodies);

  ToolModel tool_;
  double epsilon_;
  std::vector<Seen> before_;
  MovableBodies bodies_before_;
  double time_ = 0;  ///< Time of `before_`, s.
  ContactCounts counts_;
};

}  // namespace hlm::server
