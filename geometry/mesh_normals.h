// What is a mesh like at a point: is a direction a normal there, and does it rise?
#pragma once

#include <optional>

#include "hlm/geometry/mesh.h"

namespace hlm::geometry {

/// Whether none of the triangles that meet in p rises along the unit vector n: only along such a
/// normal can a shape touch the mesh there from outside. `p`: on the triangle or before it, m.
/// Behind it none is a normal of a closed mesh; an open one has a back, of which nothing is known:
/// empty.
std::optional<bool> is_normal(const Mesh& mesh, std::size_t triangle, const Vector3& p,
                              const Vector3& n);
/// Whether q (m) is over a triangle that rises from the plane of this one next to p, a point on its
/// border, and none falls below that plane there: then the plane goes on inside of the mesh.
bool is_concave(const Mesh& mesh, std::size_t triangle, const Vector3& p, const Vector3& q);

}  // namespace hlm::geometry
