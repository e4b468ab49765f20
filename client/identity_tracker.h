// Lasting identities for the contacts of an engine that does not name them.
#pragma once

#include <cstdint>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/common/tool_model.h"

namespace hlm {

struct IdentityTrackerOptions {
  /// A contact is the same one if its point on side a has moved in a's frame by no more than this
  /// between two frames, m, > 0. A contact at a's own vertex does not move there; one at a vertex
  /// of the environment moves by speed times period. More lets neighbours change places, less loses
  /// fast ones.
  double reach = 0.01;
  /// Its normal must also have turned by no more than this, rad, (0, π).
  double cone = 0.35;
  /// Frames for which a contact that is not listed keeps its identity, >= 0: engines omit one now
  /// and then.
  int memory = 3;
};

/// Gives each contact the identity of the nearest contact of the previous frame that has the same
/// two sides and the same pair, or a new one. Where the engine names features, their hash is
/// better.
class IdentityTracker {
 public:
  explicit IdentityTracker(const IdentityTrackerOptions& options = {}) : options_(options) {}

  /// Sets ReportedContact::identity. `tool`: at the configuration for which the contacts hold.
  /// Call once per frame, also without contacts.
  void assign(const ToolModel& tool, const MovableBodies& bodies, ReportedContacts& contacts);
  /// Identities given so far.
  std::uint64_t given() const noexcept { return next_ - 1; }

 private:
  struct Known {
    ContactSide a;
    ContactSide b;
    std::uint32_t pair = 0;
    Vector3 p_A = Vector3::Zero();  ///< Point on side a, a's frame, m.
    Vector3 n_A = Vector3::UnitZ();
    std::uint64_t identity = 0;
    int unseen = 0;  ///< Frames.
  };

  /// Moves the identities of known contacts to the contacts that continue them.
  void carry_over(std::vector<Known>& present);

  IdentityTrackerOptions options_;
  std::vector<Known> known_;
  std::uint64_t next_ = 1;
};

}  // namespace hlm
