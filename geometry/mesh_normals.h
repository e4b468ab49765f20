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
/// A normal of the mesh at the point p of a triangle (m), not unit: of all triangles there, each by
/// its angle (Baerentzen and Aanaes 2005). What has p as its nearest point is outside if it is on
/// the side to which this looks.
Vector3 pseudonormal(const Mesh& mesh, std::size_t triangle, const Vector3& p);
/// Whether q (m) is over a triangle that rises from the plane of this one next to p, a point on its
/// border, and none falls below that plane there: then the plane goes on inside of the mesh.
bool is_concave(const Mesh& mesh, std::size_t triangle, const Vector3& p, const Vector3& q);

}  // namespace hlm::geometry
