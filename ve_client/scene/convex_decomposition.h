// Convex parts of a concave mesh.
#pragma once

#include <vector>

#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/scene/geometry.h"

namespace hlm::ve {

/// Few pieces that together are the mesh to about 1 % of its size, by hierarchical approximate
/// convex decomposition (Mamou, Ghorbel 2009). Takes seconds for thousands of triangles, so that
/// the answer is kept in the user's cache directory ($XDG_CACHE_HOME, else ~/.cache). Throws
/// std::runtime_error if there is none.
std::vector<Hull> decomposed(const Mesh& mesh);

}  // namespace hlm::ve
