// Which bodies can the tool push, and what do they rest on?
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/geometry/feature.h"
#include "hlm/ve_client/world/proximity.h"
#include "hlm/ve_client/world/roundness.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// The movable bodies near the tool, at most kMaxBodiesAhead: those with a contact of the tool,
/// then those with a contact of one of these, and so on; with their own contacts.
class Surroundings {
 public:
  /// Both outlive this.
  Surroundings(World& world, Proximity& proximity);

  /// Finds the bodies for these contacts of the tool, σ <= epsilon (m, >= 0), in the present poses,
  /// and marks the contacts with one of them. The bodies' own contacts are those with the world,
  /// with each other and with bodies that are not reported, with friction and load, and the
  /// limits of their joints (find_limits); these alone with `shapes`, whose contacts are found
  /// elsewhere. left_to: which bodies somebody else moves; none if it is empty.
  void find(std::span<FoundContact> tool_contacts, double epsilon, bool shapes = false,
            std::function<bool(int body)> left_to = {});

  const MovableBodies& bodies() const noexcept { return bodies_; }
  /// Contacts of the latest find(), sorted by key: at most so many that all fit into an update. If
  /// there are more, the loaded and the nearest stay.
  std::span<const FoundContact> contacts() const noexcept { return contacts_; }
  /// Whether the side of a contact is one of the bodies of the latest find().
  bool reports(const ContactSide& side) const;
  /// Whether a body stops the tool as the fixed world does: it cannot move, or there was no room
  /// for it in the latest find().
  bool is_obstacle(int body) const;

 private:
  bool is_reported(int body) const;
  bool leaves_all() const;
  void report(int body);
  void add_contacts_of(int body, double epsilon);
  void share_loads();
  void add_limits(int joint, double epsilon);
  void keep_most_telling(std::size_t count);
  ContactSide side_of(int body) const;

  World& world_;
  Proximity& proximity_;
  std::vector<bool> pushable_;  ///< Bodies that their joints let move.
  std::vector<BodyRoundness> round_;
  std::function<bool(int body)> left_to_;
  std::vector<int> reported_;
  std::vector<int> left_out_;
  std::vector<int> passed_;  ///< Those that somebody else moves.
  MovableBodies bodies_;
  std::vector<FoundContact> contacts_;
};

}  // namespace hlm::ve
