#include "hlm/client/identity_tracker.h"

#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

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

/// A contact of this frame, and the nearest of the frame before that it may go on.
struct Match {
  double distance;  // m
  std::size_t contact;
  std::size_t known;

  bool operator>(const Match& other) const { return distance > other.distance; }
};

}  // namespace

void IdentityTracker::assign(const ToolModel& tool, const MovableBodies& bodies,
                             ReportedContacts& contacts) {
  std::vector<Known> present;
  for (const ReportedContact& contact : contacts) {
    const Pose X_AW = pose_of(contact.a, tool, bodies).inverse();
    Known& now = present.emplace_back();
    now.a = contact.a;
    now.b = contact.b;
    now.pair = contact.pair;
    now.p_A = X_AW * Vector3(contact.p_WC + contact.separation * contact.n_W);
    now.n_A = X_AW.R * contact.n_W;
  }
  carry_over(present);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (present[i].identity == 0) present[i].identity = next_++;
    contacts[i].identity = present[i].identity;
  }
  for (Known& before : known_) {
    if (before.identity != 0 && ++before.unseen <= options_.memory) present.push_back(before);
  }
  known_ = std::move(present);
}

void IdentityTracker::carry_over(std::vector<Known>& present) {
  const double cosine = std::cos(options_.cone);
  const double reach = options_.reach * options_.reach;
  // The nearest pair of all first; a contact whose nearest is taken looks for its next.
  std::priority_queue<Match, std::vector<Match>, std::greater<>> matches;
  const auto look = [&](std::size_t contact) {
    const Known& now = present[contact];
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t found = known_.size();
    for (std::size_t k = 0; k < known_.size(); ++k) {
      const Known& before = known_[k];
      const double distance = (before.p_A - now.p_A).squaredNorm();
      if (!(distance <= reach && distance < nearest) || before.identity == 0 ||
          before.n_A.dot(now.n_A) < cosine)
        continue;
      if (before.a != now.a || before.b != now.b || before.pair != now.pair) continue;
      nearest = distance;
      found = k;
    }
    if (found < known_.size()) matches.push({nearest, contact, found});
  };
  for (std::size_t i = 0; i < present.size(); ++i) look(i);
  while (!matches.empty()) {
    const Match match = matches.top();
    matches.pop();
    Known& before = known_[match.known];
    if (before.identity == 0) {
      look(match.contact);
    } else {
      present[match.contact].identity = std::exchange(before.identity, 0);
    }
  }
}

}  // namespace hlm
