#include "hlm/geometry/select.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

namespace hlm::geometry {
namespace {

/// A normal with a smaller share in the plane of motion constrains nothing there. Larger values
/// lose contacts with steep but real constraints; with smaller ones a contact on the plane's own
/// surface could push in the plane.
constexpr double kOutOfPlane = 1e-3;
/// Difference up to which two normals count as equal (unit vectors): rounding, many times over.
constexpr double kEqualNormal = 1e-6;
/// Difference up to which two points or separations count as equal, m: rounding, many times over.
constexpr double kSameLength = 1e-6;

Vector3 in_plane(const Vector3& a, const Vector3& planar_normal) {
  return a - planar_normal * planar_normal.dot(a);
}

bool is_same_constraint(const FoundContact& a, const FoundContact& b,
                        const Vector3& planar_normal) {
  return may_be_same(a, b) && a.key.a == b.key.a && a.key.b == b.key.b &&
         (a.n_W - b.n_W).norm() < kEqualNormal &&
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

/// A contact that was reported before stays where another is better by less than this, m: more than
/// separations change by rounding and by a hand's tremor, less than can be felt.
constexpr double kConstancy = 2e-5;
/// The same for the place of a contact in its face, m.
constexpr double kConstancyOfPlace = 2e-3;

/// Contacts within this distance, m, are one cluster. Far more takes a tool's footing away.
constexpr double kClusterRadius = 1e-3;
/// A contact that was reported before joins a cluster only at this part of the distance, and one
/// that was not is kept out of it only beyond the inverse: a border that is crossed to and fro
/// makes contacts come and go.
constexpr double kClusterHysteresis = 0.75;
/// Nor is a cluster wider than this part of the extent of all contacts: a tool of any size keeps
/// its lever arms to two hundredths.
constexpr double kClusterShare = 0.02;
/// Normals within this angle, rad, are those of one cluster and of one face, as for manifolds.
constexpr double kFaceAngle = 0.1;

/// Separations that differ by less compete by place, m: much more than a pressed face tilts, much
/// less than would leave a deep contact out for a far one.
constexpr double kSimilarSeparation = 1e-3;
/// Distance that counts as much as a difference of normals of 1 rad, m: about a tool's size.
constexpr double kNormalLength = 0.1;

bool by_key(const FoundContact& a, const FoundContact& b) { return a.key < b.key; }

double distance(const FoundContact& a, const FoundContact& b) {
  return std::hypot((a.p_WC - b.p_WC).norm(), kNormalLength * (a.n_W - b.n_W).norm());
}

bool have_one_normal(const FoundContact& a, const FoundContact& b) {
  return (a.n_W - b.n_W).norm() <= kFaceAngle;
}

/// Contacts of one link of the tool, or of one body, that have one normal: the first has the
/// smallest separation.
using Face = std::vector<const FoundContact*>;

/// `contacts` is sorted by rank.
std::vector<Face> faces_of(const std::vector<FoundContact>& contacts) {
  std::vector<Face> faces;
  for (const FoundContact& contact : contacts) {
    const auto known = std::ranges::find_if(faces, [&](const Face& face) {
      return face.front()->key.a == contact.key.a && have_one_normal(*face.front(), contact);
    });
    (known != faces.end() ? *known : faces.emplace_back()).push_back(&contact);
  }
  return faces;
}

/// The outermost contacts of a face in eight directions, each once: of any rectangle the corners.
template <class Bonus>
Face outermost(const Face& face, Bonus bonus) {
  const Vector3 e = face.front()->n_W.unitOrthogonal();
  const Vector3 f = face.front()->n_W.cross(e);
  Face corners;
  constexpr int kDirections = 8;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = 2 * std::numbers::pi * i / kDirections;
    const Vector3 along = std::cos(angle) * e + std::sin(angle) * f;
    const FoundContact* corner = *std::ranges::max_element(
        face, {}, [&](const auto* contact) { return along.dot(contact->p_WC) + bonus(*contact); });
    if (std::ranges::find(corners, corner) == corners.end()) corners.push_back(corner);
  }
  return corners;
}

/// Adds `count` of the candidates to those that are kept: each time the one farthest from all of
/// them.
void keep_farthest(const Face& candidates, std::size_t count, Face& kept) {
  std::vector<double> gaps(candidates.size(), std::numeric_limits<double>::infinity());
  const auto see = [&](const FoundContact* chosen) {
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      gaps[i] = std::min(gaps[i], distance(*candidates[i], *chosen));
      if (candidates[i] == chosen) gaps[i] = -1;
    }
  };
  for (const FoundContact* contact : kept) see(contact);
  for (; count > 0; --count) {
    const auto farthest = std::ranges::max_element(gaps);
    kept.push_back(candidates[static_cast<std::size_t>(farthest - gaps.begin())]);
    see(kept.back());
  }
}

}  // namespace

bool ContactSelection::was_selected(const FoundContact& contact) const {
  return std::ranges::binary_search(selected_, contact, by_key);
}

/// The contact's separation, m, for comparing with others.
double ContactSelection::rank(const FoundContact& contact) const {
  return contact.separation - (was_selected(contact) ? kConstancy : 0);
}

/// Leaves one contact of each cluster. `contacts` is sorted by rank.
void ContactSelection::cluster(std::vector<FoundContact>& contacts) const {
  Eigen::AlignedBox3d extent;
  for (const FoundContact& contact : contacts) extent.extend(contact.p_WC);
  const double radius = std::min(kClusterRadius, kClusterShare * extent.diagonal().norm());
  std::size_t kept = 0;
  for (const FoundContact& contact : contacts) {
    const auto end = contacts.begin() + static_cast<std::ptrdiff_t>(kept);
    const double within =
        was_selected(contact) ? radius * kClusterHysteresis : radius / kClusterHysteresis;
    const bool known = std::any_of(contacts.begin(), end, [&](const FoundContact& other) {
      return may_be_same(other, contact) && other.key.a == contact.key.a &&
             other.key.b == contact.key.b && other.axis == contact.axis &&
             (other.p_WC - contact.p_WC).norm() <= within && have_one_normal(other, contact);
    });
    if (!known) contacts[kept++] = contact;
  }
  contacts.resize(kept);
}

/// The contacts to keep if there are too many. `contacts` is sorted by rank.
std::vector<FoundContact> ContactSelection::most_telling(
    const std::vector<FoundContact>& contacts) const {
  const auto bonus = [&](const FoundContact& contact) {
    return was_selected(contact) ? kConstancyOfPlace : 0;
  };
  Face kept;
  const auto keep = [&](const FoundContact* contact) {
    if (kept.size() < kMaxSelected && std::ranges::find(kept, contact) == kept.end()) {
      kept.push_back(contact);
    }
  };
  const std::vector<Face> faces = faces_of(contacts);
  for (const Face& face : faces) keep(face.front());
  for (const Face& face : faces) {
    for (const FoundContact* corner : outermost(face, bonus)) keep(corner);
  }

  Face rest;
  for (const FoundContact& contact : contacts) {
    if (std::ranges::find(kept, &contact) == kept.end()) rest.push_back(&contact);
  }
  const std::size_t room = kMaxSelected - kept.size();
  if (room > 0) {
    const double last = rank(*rest[room - 1]);
    const auto first_from = [&](double value) {
      return std::ranges::find_if(rest, [&](const auto* other) { return rank(*other) >= value; });
    };
    const auto similar = first_from(last - kSimilarSeparation);
    const auto beyond = first_from(last + kSimilarSeparation);
    kept.insert(kept.end(), rest.begin(), similar);
    for (auto known = similar; known != beyond; ++known) {
      if (was_selected(**known)) keep(*known);
    }
    keep_farthest({similar, beyond}, kMaxSelected - kept.size(), kept);
  }
  std::vector<FoundContact> chosen;
  for (const FoundContact* contact : kept) chosen.push_back(*contact);
  return chosen;
}

std::span<const FoundContact> ContactSelection::select(
    std::span<const FoundContact> candidates, const std::optional<Vector3>& planar_normal_W) {
  std::vector<FoundContact> contacts(candidates.begin(), candidates.end());
  std::ranges::sort(contacts, by_key);
  if (planar_normal_W) contacts = planar_constraints(contacts, *planar_normal_W);
  std::ranges::stable_sort(contacts, {},
                           [&](const FoundContact& contact) { return rank(contact); });
  cluster(contacts);
  if (contacts.size() > kMaxSelected) contacts = most_telling(contacts);
  std::ranges::sort(contacts, by_key);
  selected_ = std::move(contacts);
  return selected_;
}

}  // namespace hlm::geometry
