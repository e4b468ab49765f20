#include "ve_client/contacts/select.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace hlm::ve {
namespace {

/// A normal with a smaller share in the plane of motion constrains nothing there. Larger values
/// lose contacts with steep but real constraints; with smaller ones a contact on the plane's own
/// surface could push in the plane.
constexpr double kOutOfPlane = 1e-3;
/// Difference up to which two normals count as equal (unit vectors): rounding, many times over.
constexpr double kSameNormal = 1e-6;
/// Difference up to which two points or separations count as equal, m: rounding, many times over.
constexpr double kSameLength = 1e-6;

Vector3 in_plane(const Vector3& a, const Vector3& planar_normal) {
  return a - planar_normal * planar_normal.dot(a);
}

bool is_same_constraint(const FoundContact& a, const FoundContact& b,
                        const Vector3& planar_normal) {
  return a.key.a == b.key.a && a.key.b == b.key.b && (a.n_W - b.n_W).norm() < kSameNormal &&
         std::abs(a.separation - b.separation) < kSameLength &&
         in_plane(a.p_WC - b.p_WC, planar_normal).norm() < kSameLength;
}

/// `contacts` is sorted by key.
std::vector<FoundContact> planar_constraints(const std::vector<FoundContact>& contacts,
                                             const Vector3& planar_normal) {
  std::vector<FoundContact> kept;
  for (const FoundContact& contact : contacts) {
    if (in_plane(contact.n_W, planar_normal).norm() < kOutOfPlane) continue;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const FoundContact& other) {
      return is_same_constraint(contact, other, planar_normal);
    });
    if (!known) kept.push_back(contact);
  }
  return kept;
}

/// Separations that differ by less compete by place, m: much more than a pressed face tilts, much
/// less than would leave a deep contact out for a far one.
constexpr double kSimilarSeparation = 1e-3;
/// Distance that counts as much as a difference of normals of 1 rad, m: about a tool's size.
constexpr double kNormalLength = 0.1;

double squared_distance(const FoundContact& a, const FoundContact& b) {
  return (a.p_WC - b.p_WC).squaredNorm() +
         kNormalLength * kNormalLength * (a.n_W - b.n_W).squaredNorm();
}

/// Moves `count` of the candidates behind `kept`: each time the one farthest from all that are
/// kept.
void keep_farthest(std::vector<FoundContact> candidates, std::size_t count,
                   std::vector<FoundContact>& kept) {
  std::vector<double> distance(candidates.size(), std::numeric_limits<double>::infinity());
  const auto see = [&](const FoundContact& chosen) {
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      distance[i] = std::min(distance[i], squared_distance(candidates[i], chosen));
    }
  };
  for (const FoundContact& contact : kept) see(contact);
  for (; count > 0; --count) {
    const auto farthest = std::max_element(distance.begin(), distance.end());
    kept.push_back(candidates[static_cast<std::size_t>(farthest - distance.begin())]);
    see(kept.back());
  }
}

/// The contacts to keep if there are too many; `contacts` is sorted by key.
std::vector<FoundContact> most_telling(std::vector<FoundContact> contacts) {
  if (contacts.size() <= kMaxSelected) return contacts;
  std::stable_sort(contacts.begin(), contacts.end(),
                   [](const auto& a, const auto& b) { return a.separation < b.separation; });
  const double last = contacts[kMaxSelected - 1].separation;
  const auto deeper_than = [&](double separation) {
    return std::find_if(contacts.begin(), contacts.end(),
                        [&](const auto& contact) { return contact.separation >= separation; });
  };
  const auto first_similar = deeper_than(last - kSimilarSeparation);
  const auto beyond = deeper_than(last + kSimilarSeparation);
  std::vector<FoundContact> kept(contacts.begin(), first_similar);
  keep_farthest({first_similar, beyond}, kMaxSelected - kept.size(), kept);
  return kept;
}

}  // namespace

std::vector<FoundContact> select_contacts(std::span<const FoundContact> candidates,
                                          const std::optional<Vector3>& planar_normal_W) {
  const auto by_key = [](const FoundContact& a, const FoundContact& b) { return a.key < b.key; };
  std::vector<FoundContact> contacts(candidates.begin(), candidates.end());
  std::sort(contacts.begin(), contacts.end(), by_key);
  if (planar_normal_W) contacts = planar_constraints(contacts, *planar_normal_W);
  contacts = most_telling(std::move(contacts));
  std::sort(contacts.begin(), contacts.end(), by_key);
  return contacts;
}

}  // namespace hlm::ve
