#include "hlm/geometry/skin_contacts.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "hlm/geometry/manifold.h"

namespace hlm::geometry {
namespace {

/// Distance that a contact's point may go on the tool within a frame, m: along an edge, or on a
/// rounded tool that meets a triangle of another slope. More lets contacts change places.
constexpr double kReach = 0.005;
/// Angle that its normal may turn, rad: as much as from one triangle of a round mesh to the next
/// but one. A sharper edge is felt as one.
constexpr double kCone = 0.5;
/// Distance that counts as much as a turn of 1 rad, m.
constexpr double kTurnLength = 0.01;

/// A contact of the frame before that may go on in one of this frame.
struct Candidate {
  double difference;  ///< m.
  std::size_t known;
  std::size_t contact;
};

}  // namespace

bool is_on_skin(const Pieces& pieces, const FoundContact& contact) {
  return contact.key.b.kind != SideKind::kToolLink && pieces.of(contact.other).mesh != nullptr;
}

void SkinContacts::name(const Pieces& pieces, const std::function<Pose(int link)>& X_WL,
                        std::vector<FoundContact>& contacts) {
  std::vector<Known> now;
  std::vector<std::size_t> places;  // Indices of `now` among the contacts.
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const FoundContact& contact = contacts[i];
    if (contact.key.b.kind == SideKind::kToolLink || !pieces.of(contact.other).is_by_skin) continue;
    const Vector3 p_W = contact.p_WC + contact.separation * contact.n_W;
    const Pose X_LW = X_WL(static_cast<int>(contact.key.a.index)).inverse();
    now.push_back({contact.key, contact.key, X_LW * p_W, contact.n_W});
    places.push_back(i);
  }

  std::vector<bool> gone(known_.size(), true);
  std::vector<bool> is_new(now.size(), true);
  const auto go_on = [&](std::size_t known, std::size_t contact) {
    now[contact].name = known_[known].name;
    gone[known] = is_new[contact] = false;
  };
  for (std::size_t i = 0; i < now.size(); ++i) {
    const auto same = std::ranges::find(known_, now[i].found, &Known::found);
    if (same != known_.end()) go_on(static_cast<std::size_t>(same - known_.begin()), i);
  }
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < now.size(); ++i) {
    for (std::size_t k = 0; is_new[i] && k < known_.size(); ++k) {
      if (!gone[k] || known_[k].found.a != now[i].found.a || known_[k].found.b != now[i].found.b) {
        continue;
      }
      const double distance = (known_[k].p_L - now[i].p_L).norm();
      const double turn = (known_[k].n_W - now[i].n_W).norm();
      if (distance > kReach || turn > kCone) continue;
      candidates.push_back({distance + kTurnLength * turn, k, i});
    }
  }
  std::ranges::stable_sort(candidates, {}, &Candidate::difference);
  for (const Candidate& candidate : candidates) {
    if (gone[candidate.known] && is_new[candidate.contact]) {
      go_on(candidate.known, candidate.contact);
    }
  }
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (is_new[i]) {
      now[i].name.b_feature = {FeatureKind::kFace, now[i].found.b_feature.shape, 0};
      now[i].name.face = kTellsApart + ++next_ % kBeside;
    }
    contacts[places[i]].key = now[i].name;
  }
  known_ = std::move(now);
}

}  // namespace hlm::geometry
