// Which normals has the surface that several pieces make together?
#pragma once

#include "hlm/geometry/piece.h"

namespace hlm::geometry {

/// The part of v that is across the unit vector n.
inline Vector3 across(const Vector3& v, const Vector3& n) { return v - v.dot(n) * n; }

/// The normal of the surface of these pieces at a point of one of them that is nearest to the unit
/// vector n; zero if none is within 45° of it. Those of all sides at the point count that no
/// other piece covers, and what lies between them.
Vector3 surface_normal(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces);

/// Sets the bound of the normals that the surface can have at a piece of a skin among such.
void bound_normals(Piece& piece);

/// Whether all of the surface's normals at a point are n, to 2°.
bool is_flat(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces);

}  // namespace hlm::geometry
