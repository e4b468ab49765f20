#include "hlm/geometry/separation.h"

#include "hlm/geometry/penetration.h"

namespace hlm::geometry {
namespace {

CoreSeparation separation_from_half_space(const CorePair& pair) {
  const Vector3 n = Vector3::UnitZ();
  const double height = pair.tool_support(-n).z();
  return {height, height, n, {}};
}

/// The separation of curved cores a few micrometres apart, where rounding stopped the search early.
CoreSeparation made_exact(const CorePair& pair, const ClosestPoints& nearest) {
  const Vector3 n = closest_points_moved_apart(pair, nearest.n_B, nearest.lower).n_B;
  const double gap = pair.gap(n);
  if (gap > nearest.lower) return {gap, nearest.upper, n, {}};
  return {nearest.lower, nearest.upper, nearest.n_B, {}};
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
  if (nearest.upper - nearest.lower > kAccuracy) return made_exact(pair, nearest);
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
