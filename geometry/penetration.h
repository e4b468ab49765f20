// The signed distance of cores that touch or overlap: which normal has the largest gap?
#pragma once

#include "hlm/geometry/core_separation.h"

namespace hlm::geometry {

/// `nearest` is the answer of closest_points(), whose relation is kTouching. Polytopes: exact, over
/// all normals of faces and cross products of edges. Hulls: exact, by an expanding polytope. Curved
/// cores: that and those axes.
CoreSeparation find_penetration(const CorePair& pair, const ClosestPoints& nearest);

/// Overlap of cores along a normal near `before_B` (unit), that of the same pair a little earlier,
/// instead of the one with the largest gap: a tool that is pressed into a thin body, or far into a
/// thick one, stays on the side from which it came. Of faces and edges the one with the largest gap
/// within 30° of it, for curved cores otherwise itself; `upper` equals `gap`.
CoreSeparation find_penetration_near(const CorePair& pair, const Vector3& before_B);

}  // namespace hlm::geometry
