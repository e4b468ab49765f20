// Convex pieces that stand for a mesh.
#pragma once

#include <vector>

#include "hlm/contacts/shape.h"
#include "hlm/world/mesh.h"

namespace hlm::ve {

/// Whether the mesh is closed and encloses its convex hull's volume to a part in ten thousand.
bool is_convex(const Mesh& mesh);

/// One piece for each triangle, in their order: the triangle and a smaller one behind it, at most
/// 10 mm deep and inside of what the mesh encloses. Neighbours adjoin without a gap. For meshes
/// that do not move.
std::vector<Hull> skin_of(const Mesh& mesh);

/// Few pieces that together are the mesh to about 1 % of its size, by hierarchical approximate
/// convex decomposition (Mamou, Ghorbel 2009). Takes seconds for thousands of triangles, so that
/// the answer is kept in the user's cache directory ($XDG_CACHE_HOME, else ~/.cache). Throws
/// std::runtime_error if there is none.
std::vector<Hull> decomposed(const Mesh& mesh);

}  // namespace hlm::ve
