#include "ve_client/contacts/separation.h"

#include "ve_client/contacts/penetration.h"

namespace hlm::ve {
namespace {

CoreSeparation separation_from_half_space(const CorePair& pair) {
  const Vector3 n = Vector3::UnitZ();
  const double height = pair.tool_support(-n).z();
  return {height, height, n};
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
  CoreSeparation separation{nearest.lower, nearest.upper, nearest.n_B};
  if (!(nearest.upper - nearest.lower > kAccuracy)) return separation;
  // Curved cores a few micrometres apart: rounding stops the search early.
  const Vector3 n = closest_points_moved_apart(pair, separation.n_B, separation.gap).n_B;
  const double gap = pair.gap(n);
  if (gap > separation.gap) {
    separation.gap = gap;
    separation.n_B = n;
  }
  return separation;
}

Witness find_witness(const CorePair& pair, const CoreSeparation& separation) {
  if (pair.body.is_half_space()) {
    const Vector3 p_tool = pair.tool_support(-separation.n_B);
    return {p_tool, p_tool - separation.gap * separation.n_B};
  }
  const ClosestPoints nearest = closest_points_moved_apart(pair, separation.n_B, separation.gap);
  return {nearest.p_tool, nearest.p_body};
}

}  // namespace hlm::ve
