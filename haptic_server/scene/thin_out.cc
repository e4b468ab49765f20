#include "hlm/server_scene/thin_out.h"

#include <algorithm>
#include <tuple>

namespace hlm::server {
namespace {

using geometry::FoundContact;

/// A normal with less in the plane constrains nothing there, as in ContactSelection.
constexpr double kOutOfPlane = 1e-3;
/// Contacts of a planar tool that differ by less in their plane, m and m/m, are one.
constexpr double kSamePlace = 1e-6;

/// The first distance within which contacts stand for each other, m; it grows until they fit.
constexpr double kNear = 1e-3;
/// Nor is it more than this part of the extent of all contacts at first: small tools keep their
/// lever arms.
constexpr double kNearShare = 0.02;
constexpr double kLeastNear = 1e-6;
/// By how much.
constexpr double kWider = 1.5;
/// Beyond this, m, none stands for another: the deepest stay.
constexpr double kFar = 1;
/// The deepest so many contacts are compared: each with each takes the tick's time.
constexpr std::size_t kMostCompared = 512;
/// Cosine of the angle up to which normals are about the same: 0.1 rad.
constexpr double kSimilar = 0.995;

Vector3 in_plane(const Vector3& v, const Vector3& normal) { return v - normal.dot(v) * normal; }

bool are_of_same(const FoundContact& x, const FoundContact& y) {
  return x.key.a == y.key.a && x.key.b == y.key.b;
}

/// Moves contacts to the front for which there is none before them that `stands_for` them. Returns
/// how many there are, or more than `most` as soon as that is clear.
template <class StandsFor>
std::size_t keep_first(std::vector<FoundContact>& contacts, std::size_t most,
                       StandsFor stands_for) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size() && kept <= most; ++i) {
    const auto end = contacts.begin() + static_cast<std::ptrdiff_t>(kept);
    const bool stands = std::any_of(contacts.begin(), end, [&](const FoundContact& other) {
      return stands_for(other, contacts[i]);
    });
    if (stands) continue;
    std::swap(contacts[kept], contacts[i]);
    ++kept;
  }
  return kept;
}

bool is_deeper(const FoundContact& x, const FoundContact& y) {
  return std::tie(x.separation, x.key) < std::tie(y.separation, y.key);
}

}  // namespace

void keep_planar(std::vector<FoundContact>& contacts, const Vector3& planar_normal_W) {
  const Vector3& along = planar_normal_W;
  std::erase_if(contacts, [&](const FoundContact& contact) {
    return in_plane(contact.n_W, along).norm() < kOutOfPlane;
  });
  std::ranges::sort(contacts, {}, &FoundContact::key);
  const auto is_same = [&](const FoundContact& other, const FoundContact& contact) {
    return are_of_same(other, contact) && (other.n_W - contact.n_W).norm() < kSamePlace &&
           in_plane(other.p_WC - contact.p_WC, along).norm() < kSamePlace;
  };
  contacts.resize(keep_first(contacts, contacts.size(), is_same));
}

void thin_out(std::vector<FoundContact>& contacts, std::size_t most) {
  std::ranges::sort(contacts, is_deeper);
  if (contacts.size() > kMostCompared) contacts.resize(kMostCompared);
  Eigen::AlignedBox3d extent;
  for (const FoundContact& contact : contacts) extent.extend(contact.p_WC);
  double near = std::max(std::min(kNear, kNearShare * extent.diagonal().norm()), kLeastNear);
  for (;; near *= kWider) {
    const auto is_near = [&](const FoundContact& other, const FoundContact& contact) {
      return geometry::may_be_same(other, contact) && are_of_same(other, contact) &&
             other.n_W.dot(contact.n_W) > kSimilar && (other.p_WC - contact.p_WC).norm() < near;
    };
    const std::size_t kept = keep_first(contacts, most, is_near);
    if (kept <= most || near > kFar) return contacts.resize(std::min(kept, most));
    std::ranges::sort(contacts, is_deeper);
  }
}

}  // namespace hlm::server
