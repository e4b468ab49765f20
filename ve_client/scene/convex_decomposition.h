// Convex parts of a concave mesh.
#pragma once

#include <string>
#include <vector>

#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

/// Few pieces that together are the mesh to about 1 % of its size, by hierarchical approximate
/// convex decomposition (Mamou, Ghorbel 2009). Takes seconds for thousands of triangles, so that
/// the answer is kept (kept_pieces.h), and `progress` hears how far it is of the mesh `name`.
/// Throws std::runtime_error if there is none, or it was stopped.
std::vector<Hull> decomposed(const Mesh& mesh, const std::string& name = "mesh",
                             const Progress& progress = {});

}  // namespace hlm::ve
