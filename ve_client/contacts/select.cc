#include "ve_client/contacts/select.h"

#include <algorithm>
#include <tuple>
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

bool is_same_constraint(const ReportedContact& a, const ReportedContact& b,
                        const Vector3& planar_normal) {
  return a.key.link == b.key.link && a.key.body == b.key.body &&
         (a.n_W - b.n_W).norm() < kSameNormal &&
         std::abs(a.separation - b.separation) < kSameLength &&
         in_plane(a.p_WC - b.p_WC, planar_normal).norm() < kSameLength;
}

/// `contacts` is sorted by key.
std::vector<ReportedContact> planar_constraints(const std::vector<ReportedContact>& contacts,
                                                const Vector3& planar_normal) {
  std::vector<ReportedContact> kept;
  for (const ReportedContact& contact : contacts) {
    if (in_plane(contact.n_W, planar_normal).norm() < kOutOfPlane) continue;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const ReportedContact& other) {
      return is_same_constraint(contact, other, planar_normal);
    });
    if (!known) kept.push_back(contact);
  }
  return kept;
}

}  // namespace

ReportedContacts select_contacts(std::span<const ReportedContact> candidates,
                                 const std::optional<Vector3>& planar_normal_W) {
  const auto by_key = [](const ReportedContact& a, const ReportedContact& b) {
    return a.key < b.key;
  };
  const auto by_separation = [](const ReportedContact& a, const ReportedContact& b) {
    return std::tie(a.separation, a.key) < std::tie(b.separation, b.key);
  };
  std::vector<ReportedContact> contacts(candidates.begin(), candidates.end());
  std::sort(contacts.begin(), contacts.end(), by_key);
  if (planar_normal_W) contacts = planar_constraints(contacts, *planar_normal_W);
  if (contacts.size() > kMaxContacts) {
    std::sort(contacts.begin(), contacts.end(), by_separation);
    contacts.resize(kMaxContacts);
    std::sort(contacts.begin(), contacts.end(), by_key);
  }
  return {contacts.begin(), contacts.end()};
}

}  // namespace hlm::ve
