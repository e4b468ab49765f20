#include "hlm/geometry/separation.h"

#include <algorithm>

#include "hlm/geometry/penetration.h"
#include "hlm/geometry/tolerances.h"

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

/// Normals of the lateral surface of a cylinder on a vertex or an edge of a polytope: what a search
/// finds of them to 1e-5 rad, exactly.
template <class Use>
void for_each_lateral_normal(const CorePair& pair, const Vector3& n_B, const Use& use) {
  const bool of_tool = pair.tool.is_cylinder();
  if (!of_tool && !pair.body.is_cylinder()) return;
  const Convex& other = of_tool ? pair.body : pair.tool;
  if (!other.is_polytope()) return;
  const Vector3 axis = of_tool ? Vector3(pair.R_BT.col(2)) : Vector3(Vector3::UnitZ());
  const Vector3 middle = of_tool ? pair.p_BT : Vector3(Vector3::Zero());
  if (std::abs(n_B.dot(axis)) > narrow::kSideways) return;
  const auto towards = [&](const Vector3& n) {
    const double norm = n.norm();
    if (norm > 0) use(Vector3((n.dot(n_B) > 0 ? 1 / norm : -1 / norm) * n));
  };
  const Vector3 p = of_tool ? pair.body_support(n_B) : pair.tool_support(-n_B);
  const Vector3 arm = p - middle;
  towards(arm - arm.dot(axis) * axis);
  const Vector3 up = of_tool ? n_B : Vector3(-(pair.R_BT.transpose() * n_B));
  const Patch edge = other.edge_facing(up);
  if (edge.corners.size() != 2) return;
  const Vector3 along = edge.corners[1].p - edge.corners[0].p;
  towards(axis.cross(of_tool ? along : Vector3(pair.R_BT * along)));
}

/// Takes the normal that features of the cores give in place of one that is no better but for
/// rounding.
CoreSeparation with_exact_normal(const CorePair& pair, CoreSeparation separation) {
  CoreSeparation best = separation;
  for_each_lateral_normal(pair, separation.n_B, [&](const Vector3& n) {
    const double gap = pair.gap(n);
    const bool is_first = best.n_B == separation.n_B;
    if (gap < best.gap - (is_first ? narrow::kLength : 0) ||
        n.dot(separation.n_B) < narrow::kSameNormal)
      return;
    best.gap = gap;
    best.n_B = n;
  });
  return best;
}

}  // namespace

std::optional<CoreSeparation> find_separation(const CorePair& pair, double beyond,
                                              Vector3& apart_B) {
  if (pair.body.is_half_space()) {
    const CoreSeparation separation = separation_from_half_space(pair);
    apart_B = separation.n_B;
    if (separation.gap > beyond) return {};
    return separation;
  }
  const ClosestPoints nearest = closest_points(pair, beyond);
  switch (nearest.relation) {
    case ClosestPoints::Relation::kBeyond:
      apart_B = nearest.n_B;
      return {};
    case ClosestPoints::Relation::kTouching:
      return with_exact_normal(pair, find_penetration(pair, nearest));
    case ClosestPoints::Relation::kSeparate:
      break;
  }
  if (!(std::abs(nearest.upper - nearest.lower) <= narrow::kAccuracy)) {
    return with_exact_normal(pair, made_exact(pair, nearest));
  }
  CoreSeparation separation{nearest.lower, nearest.upper, nearest.n_B, {}};
  if (nearest.lower > narrow::kMovedApart) separation.nearest = {nearest.p_tool, nearest.p_body};
  return with_exact_normal(pair, separation);
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
