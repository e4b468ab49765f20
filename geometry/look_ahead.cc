#include "hlm/geometry/look_ahead.h"

#include <algorithm>
#include <limits>

#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {
namespace {

/// The place between two looks where the gap that they tell is least. The gap is convex along the
/// way, and each look is a tangent of it.
struct Crossing {
  double share;
  double gap;  ///< m.
};
Crossing crossing(const Look& a, const Look& b, const Vector3& travel_B) {
  const double slope_a = a.separation.n_B.dot(travel_B);
  const double slope_b = b.separation.n_B.dot(travel_B);
  const double at_b = a.separation.gap + (b.share - a.share) * slope_a;
  const double turn = slope_b - slope_a;
  const double back = turn > 0 ? (b.separation.gap - at_b) / turn : 0;
  const double share = std::clamp(b.share - back, a.share, b.share);
  return {share, a.separation.gap + (share - a.share) * slope_a};
}

}  // namespace

Looks looks_ahead(const CorePair& pair, const CoreSeparation& now, const Vector3& travel_B) {
  Looks looks{{0, now}};
  const auto look = [&](std::size_t at, double share) {
    const auto there =
        find_separation(moved(pair, share * travel_B), std::numeric_limits<double>::infinity());
    if (!there || !there->is_confirmed()) return false;
    looks.insert(looks.begin() + static_cast<std::ptrdiff_t>(at), {share, *there});
    return true;
  };
  bool more = look(1, 1);
  while (more && looks.size() < looks.capacity()) {
    std::size_t at = 1;
    Crossing least = crossing(looks[0], looks[1], travel_B);
    for (std::size_t i = 2; i < looks.size(); ++i) {
      const Crossing other = crossing(looks[i - 1], looks[i], travel_B);
      if (other.gap >= least.gap) continue;
      least = other;
      at = i;
    }
    more = least.gap < pair.tool.margin() + pair.body.margin() + narrow::kClear &&
           look(at, least.share);
  }
  return looks;
}

}  // namespace hlm::geometry
