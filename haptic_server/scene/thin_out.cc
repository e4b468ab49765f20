#include "hlm/haptic_server/scene/thin_out.h"

#include <algorithm>
#include <cstdint>
#include <tuple>

#include "hlm/geometry/select.h"
#include "hlm/geometry/work.h"

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
/// Contacts of one search: what the scene's finder has room for.
constexpr std::size_t kMostSearched = 2048;
/// Work of two contacts that are compared, and of one that is sorted.
constexpr std::uint64_t kCompared = 4;
constexpr std::uint64_t kSorted = 60;
/// Cosine of the angle up to which normals are about the same: 0.1 rad.
constexpr double kSimilar = 0.995;

Vector3 in_plane(const Vector3& v, const Vector3& normal) { return v - normal.dot(v) * normal; }

bool are_of_same(const FoundContact& x, const FoundContact& y) {
  return x.key.a == y.key.a && x.key.b == y.key.b;
}

/// Places of contacts in their list: contacts themselves take long to move.
using Places = StaticVector<std::uint16_t, kMostSearched>;

/// Moves places to the front for whose contacts there is none before them that `stands_for` them,
/// in their order. Returns how many there are, or more than `most` as soon as that is clear.
template <class StandsFor>
std::size_t keep_first(const std::vector<FoundContact>& contacts, Places& places, std::size_t most,
                       StandsFor stands_for) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < places.size() && kept <= most; ++i) {
    geometry::Work::add(kCompared * kept);
    const auto end = places.begin() + static_cast<std::ptrdiff_t>(kept);
    const bool stands = std::any_of(places.begin(), end, [&](std::uint16_t other) {
      return stands_for(contacts[other], contacts[places[i]]);
    });
    if (stands) continue;
    std::swap(places[kept], places[i]);
    ++kept;
  }
  return kept;
}

bool is_deeper(const FoundContact& x, const FoundContact& y) {
  return std::tie(x.separation, x.key) < std::tie(y.separation, y.key);
}

/// Sorts places by depth, and leaves the deepest `most`.
void keep_deepest(const std::vector<FoundContact>& contacts, Places& places, std::size_t most) {
  const auto deeper = [&](std::uint16_t x, std::uint16_t y) {
    return is_deeper(contacts[x], contacts[y]);
  };
  geometry::Work::add(kSorted * places.size());
  if (places.size() > most) {
    const auto last = places.begin() + static_cast<std::ptrdiff_t>(most);
    std::nth_element(places.begin(), last, places.end(), deeper);
    places.resize(most);
  }
  std::ranges::sort(places, deeper);
}

/// Of contacts that differ only in their place along the planar tool's normal one stays, but those
/// of a body, which is turned by them out of that plane.
void keep_planar(const std::vector<FoundContact>& contacts, const Vector3& along, Places& places) {
  std::ranges::sort(places, {}, [&](std::uint16_t place) { return contacts[place].key; });
  const auto is_same = [&](const FoundContact& other, const FoundContact& contact) {
    return contact.key.b.kind != SideKind::kMovableBody && are_of_same(other, contact) &&
           (other.n_W - contact.n_W).norm() < kSamePlace &&
           in_plane(other.p_WC - contact.p_WC, along).norm() < kSamePlace;
  };
  places.resize(keep_first(contacts, places, places.size(), is_same));
  keep_deepest(contacts, places, places.size());
}

/// Widens what stands for each other until no more than `most` are left, or its work is spent.
void keep_apart(const std::vector<FoundContact>& contacts, Places& places, std::size_t most) {
  Eigen::AlignedBox3d extent;
  for (const std::uint16_t place : places) extent.extend(contacts[place].p_WC);
  double near = std::max(std::min(kNear, kNearShare * extent.diagonal().norm()), kLeastNear);
  const Places deepest = places;
  for (;; near *= kWider) {
    const auto is_near = [&](const FoundContact& other, const FoundContact& contact) {
      return geometry::may_be_same(other, contact) && are_of_same(other, contact) &&
             other.n_W.dot(contact.n_W) > kSimilar && (other.p_WC - contact.p_WC).norm() < near;
    };
    const std::size_t kept = keep_first(contacts, places, most, is_near);
    if (kept <= most) return places.resize(kept);
    places = deepest;
    if (near > kFar || geometry::Work::is_spent()) return places.resize(most);
  }
}

}  // namespace

void thin_out(std::vector<FoundContact>& contacts, const std::optional<Vector3>& planar_normal_W,
              std::size_t most) {
  const auto constrains = [&](const FoundContact& contact) {
    return !planar_normal_W || in_plane(contact.n_W, *planar_normal_W).norm() >= kOutOfPlane;
  };
  Places places;
  for (std::size_t i = 0; i < contacts.size() && places.size() < places.capacity(); ++i) {
    if (constrains(contacts[i])) places.push_back(static_cast<std::uint16_t>(i));
  }
  keep_deepest(contacts, places, kMostCompared);
  if (planar_normal_W) keep_planar(contacts, *planar_normal_W, places);
  keep_apart(contacts, places, most);
  StaticVector<FoundContact, geometry::kMaxSelected> kept;
  for (const std::uint16_t place : places) kept.push_back(contacts[place]);
  contacts.assign(kept.begin(), kept.end());
}

}  // namespace hlm::server
