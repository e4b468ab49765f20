#include "hlm/geometry/separation.h"

#include <algorithm>

#include "hlm/geometry/penetration.h"

namespace hlm::geometry {
namespace {

CoreSeparation separation_from_half_space(const CorePair& pair) {
  const Vector3 n = Vector3::UnitZ();
  const double height = pair.tool_support(-n).z();
  return {height, height, n, {}};
}

/// The separation where rounding stopped the search early: of cores a few micrometres apart, or of
/// a small one and one of metres. The cores are moved apart along the normal, and searched again:
/// the points found there are points of the cores, wherever these are. Their distance also replaces
/// an upper bound that a sliver has made too small.
CoreSeparation made_exact(const CorePair& pair, const ClosestPoints& nearest) {
  const ClosestPoints apart = closest_points_moved_apart(pair, nearest.n_B, nearest.lower);
  const double upper =
      std::min((nearest.p_tool - nearest.p_body).norm(), (apart.p_tool - apart.p_body).norm());
  const double gap = pair.gap(apart.n_B);
  const CoreSeparation exact = gap > nearest.lower
                                   ? CoreSeparation{gap, upper, apart.n_B, {}}
                                   : CoreSeparation{nearest.lower, upper, nearest.n_B, {}};
  // No two points are nearer than none: an overlap has to be proved from inside.
  return exact.gap < 0 && !exact.is_confirmed() ? find_penetration(pair, nearest) : exact;
}

}  // namespace

std::optional<CoreSeparation> find_separation(const CorePair& pair, double beyond) {
  if (pair.body.is_half_space()) {
    const CoreSeparation separation = separation_from_half_space(pair);
    if (separation.gap > beyond) return {};
    return separation;
  }
  const ClosestPoints nearest = closest_points(pair, beyond);
  switch (nearest.relation) {
    case ClosestPoints::Relation::kBeyond:
      return {};
    case ClosestPoints::Relation::kTouching:
      return find_penetration(pair, nearest);
    case ClosestPoints::Relation::kSeparate:
      break;
  }
  if (!(std::abs(nearest.upper - nearest.lower) <= kAccuracy)) return made_exact(pair, nearest);
  CoreSeparation separation{nearest.lower, nearest.upper, nearest.n_B, {}};
  if (nearest.lower > kMovedApart) separation.nearest = {nearest.p_tool, nearest.p_body};
  return separation;
}

Witness find_witness(const CorePair& pair, const CoreSeparation& separation) {
  if (pair.body.is_half_space()) {
    const Vector3 p_tool = pair.tool_support(-separation.n_B);
    return {p_tool, p_tool - separation.gap * separation.n_B};
  }
  if (separation.nearest) return *separation.nearest;
  const ClosestPoints nearest = closest_points_moved_apart(pair, separation.n_B, separation.gap);
  return {nearest.p_tool, nearest.p_body};
}

}  // namespace hlm::geometry
