// Is a place on the surface of all pieces of a body together?
#pragma once

#include <span>

#include "hlm/geometry/pieces.h"

namespace hlm::geometry {

/// Whether a point of a piece is on the surface that it makes with the others of its assembly: a
/// little out along the unit normal it lies in none of them. A piece that covers it by less than a
/// tool is pressed in is passed along the surface. All in the assembly's frame F, m.
bool is_on_union(const Assembly& assembly, const Piece& piece, const Vector3& p_F,
                 const Vector3& n_F) noexcept;
/// The same as far as these pieces, solids of the assembly, may cover it.
bool is_outside(std::span<const Piece* const> solids, const Piece& piece, const Vector3& p_F,
                const Vector3& n_F) noexcept;
/// Whether the surface goes on in another piece beyond the border of a face of this one, at a point
/// of that: `face_F` is the face's normal, `beyond_F` the direction along it, both unit. `on_rim`:
/// it is on the rim of a sheet, which may go on in itself across a T-junction; where it bends, its
/// triangles adjoin.
bool goes_on(const Assembly& assembly, const Piece& piece, const Vector3& p_F,
             const Vector3& face_F, const Vector3& beyond_F, bool on_rim = false) noexcept;
/// Whether another piece is, a little along `beyond_F` from a point of this one, as high along the
/// normal as that point, to rounding: then the normal is none of all together. All unit, m.
bool rises_to(const Assembly& assembly, const Piece& piece, const Vector3& p_F, const Vector3& n_F,
              const Vector3& beyond_F) noexcept;

}  // namespace hlm::geometry
