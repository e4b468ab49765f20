#include "hlm/client/identity_tracker.h"

#include <algorithm>
#include <cmath>

namespace hlm {
namespace {

/// Where side a is. A body's turning is not reported: its axes are those of the world.
Pose pose_of(const ContactSide& side, const ToolModel& tool, const MovableBodies& bodies) {
  if (side.kind == SideKind::kToolLink && side.index < static_cast<std::uint32_t>(tool.links())) {
    return tool.X_WL(static_cast<int>(side.index));
  }
  Pose X_WB;
  for (const MovableBody& body : bodies) {
    if (side.kind == SideKind::kMovableBody && body.id == side.index) X_WB.p = body.p_WCom;
  }
  return X_WB;
}

/// A contact of this frame that may go on one of the frame before.
struct Match {
  double distance;  // m
  std::size_t contact;
  std::size_t known;
};

}  // namespace

void IdentityTracker::assign(const ToolModel& tool, const MovableBodies& bodies,
                             ReportedContacts& contacts) {
  const double cosine = std::cos(options_.cone);
  std::vector<Known> present;
  std::vector<Match> matches;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const ReportedContact& contact = contacts[i];
    const Pose X_AW = pose_of(contact.a, tool, bodies).inverse();
    Known& now = present.emplace_back();
    now.a = contact.a;
    now.b = contact.b;
    now.pair = contact.pair;
    now.p_A = X_AW * Vector3(contact.p_WC + contact.separation * contact.n_W);
    now.n_A = X_AW.R * contact.n_W;
    for (std::size_t k = 0; k < known_.size(); ++k) {
      const Known& before = known_[k];
      if (before.a != now.a || before.b != now.b || before.pair != now.pair) continue;
      const double distance = (before.p_A - now.p_A).norm();
      if (distance <= options_.reach && before.n_A.dot(now.n_A) >= cosine) {
        matches.push_back({distance, i, k});
      }
    }
  }
  std::ranges::sort(matches, {}, &Match::distance);
  for (const Match& match : matches) {
    Known& before = known_[match.known];
    if (before.identity == 0 || present[match.contact].identity != 0) continue;  // Taken.
    present[match.contact].identity = before.identity;
    before.identity = 0;
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (present[i].identity == 0) present[i].identity = next_++;
    contacts[i].identity = present[i].identity;
  }
  for (Known& before : known_) {
    if (before.identity != 0 && ++before.unseen <= options_.memory) present.push_back(before);
  }
  known_ = std::move(present);
}

}  // namespace hlm
