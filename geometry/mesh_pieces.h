// Convex pieces that stand for a mesh.
#pragma once

#include <vector>

#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"

namespace hlm::geometry {

/// Whether the mesh is closed and encloses its convex hull's volume to a part in ten thousand.
bool is_convex(const Mesh& mesh);

/// Depth of the skin, m. A tool deeper than half of it in a piece may leave on the wrong side.
inline constexpr double kSkinDepth = 0.01;

/// One piece for each triangle, in their order: the triangle and a smaller one behind it, at most
/// 10 mm deep and inside of what the mesh encloses, if it does. Neighbours adjoin without a gap.
std::vector<Hull> skin_of(const Mesh& mesh);

}  // namespace hlm::geometry
