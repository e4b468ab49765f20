// One piece of a rigid assembly: what bounds it, and which pieces are at a point of it.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/common/static_vector.h"
#include "hlm/geometry/convex.h"
#include "hlm/geometry/feature.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/mesh_solid.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {

/// Pieces that are no farther apart than this leave no gap between them, m. A gap that a tool could
/// feel is wider; files that give places to a tenth of a millimetre make such.
inline constexpr double kEdgeGap = 1.5e-4;
/// Faces whose heights differ by less make no step, m. More hides steps that can be felt.
inline constexpr double kEdgeStep = 3e-5;

/// One piece, convex or a solid, in the frame F of its assembly: the world for fixed bodies, else
/// its body's.
struct Piece {
  struct Plane {
    Vector3 n_F;
    double offset = 0;  ///< n_Fᵀ x of its points, m.
  };
  /// The face of a piece, which stands for all coplanar faces that go on in each other; or a
  /// corner, for all in its place.
  struct Surface {
    CollisionId id;
    std::uint16_t face = 0;
    bool shared = false;  ///< Whether it is of several pieces.
    auto operator<=>(const Surface&) const = default;
  };

  CollisionId id;
  const Convex* convex = nullptr;  ///< Null: a solid.
  const MeshSolid* solid = nullptr;
  Pose X_FG;
  Friction friction = {};               ///< Of its material.
  const Mesh* mesh = nullptr;           ///< What it is of the skin of, in G; mostly null.
  std::size_t triangle = 0;             ///< Triangle of that mesh which the piece is behind.
  std::array<Vector3, 3> triangle_F{};  ///< Its corners, m.
  std::size_t front = 0;                ///< The face of a piece of a skin that is the triangle,
  std::uint32_t rims = 0;               ///< and those at a sheet's border, a bit each.
  Eigen::AlignedBox3d bounds_F;
  std::vector<Plane> planes;      ///< Planes of the core's faces, in their order.
  std::vector<Surface> surfaces;  ///< Surfaces by face; empty if none goes on in another's.
  std::vector<Surface> corners;   ///< Corners by vertex, `face` their number; empty as surfaces.
  std::vector<Piece*> adjoining;  ///< Adjoining pieces by the smallest x of their bounds.
  double widest = 0;              ///< Widest of their bounds along x, m.
  bool is_by_skin = false;        ///< It is of a skin, or adjoins a piece of one.
  /// What all normals of the surface at a piece of a skin are near, and the least that a unit
  /// vector has along it for the surface to have a normal within 45° of it; -2: nothing is known.
  Vector3 middle_normal_F = Vector3::UnitZ();
  double least_along = -2;
};

/// Whether a shape at X_FS is before the triangle of a piece of a skin. `was`:
/// whether it was a little earlier, which goes on while it crosses the triangle's plane.
bool is_before(const Piece& piece, const Convex& shape, const Pose& X_FS,
               std::optional<bool> was = {});

/// What of a piece's surface is near a point.
struct PieceSide {
  Vector3 n_F = Vector3::UnitZ();   ///< Outward, unit.
  double height = 0;                ///< Height of the point over it, m.
  std::optional<std::size_t> face;  ///< Face of the core; none: curved.
};
inline constexpr std::size_t kMaxSides = 16;
using PieceSides = StaticVector<PieceSide, kMaxSides>;

/// Whether a side of a piece can be felt: of a piece of a skin only the triangle, and a sheet's
/// rim.
bool is_surface(const Piece& piece, const PieceSide& side);

/// Of a curved surface the part that looks to the point.
std::optional<PieceSide> curved_side(const Piece& piece, const Vector3& p_F);

/// Work of a plane side, and how many of them a curved side takes the time of.
inline constexpr std::uint64_t kSideWork = 1;
inline constexpr std::uint64_t kCurvedSides = 90;

/// Calls `use(side)` for the sides that bound a piece, until it returns false: the planes of
/// its faces, then its curved_side().
template <class Use>
void for_each_side(const Piece& piece, const Vector3& p_F, Use use) {
  for (std::size_t i = 0; i < piece.planes.size(); ++i) {
    const auto& [n_F, offset] = piece.planes[i];
    if (!use(PieceSide{n_F, n_F.dot(p_F) - offset, i})) return Work::add(kSideWork * (i + 1));
  }
  Work::add(kSideWork * piece.planes.size());
  if (const auto side = curved_side(piece, p_F)) {
    Work::add(kSideWork * kCurvedSides);
    use(*side);
  }
}

/// A point, or about the nearest to it in a piece.
Vector3 within(const Piece& piece, const Vector3& p_F);
/// Whether a point is in a convex piece or no farther outside of each of its sides than `slack`, m.
bool contains(const Piece& piece, const Vector3& p_F, double slack);
/// The sides that are no farther from a point than `reach` on either side, m; the first kMaxSides.
PieceSides sides_at(const Piece& piece, const Vector3& p_F, double reach);

/// The pieces at a point of a piece: that one, and those that adjoin it there. Should more
/// triangles of a mesh meet in a point, those left out look open.
inline constexpr std::size_t kMaxPiecesAtPoint = 64;
using PiecesAtPoint = StaticVector<const Piece*, kMaxPiecesAtPoint>;
PiecesAtPoint pieces_at(const Piece& piece, const Vector3& p_F);
/// Whether a point is in one of these pieces other than its own.
bool is_covered(const Vector3& p_F, const Piece& own, const PiecesAtPoint& pieces);

}  // namespace hlm::geometry
