// The convex pieces or solids that stand for a shape.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "hlm/geometry/convex.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/mesh_solid.h"
#include "hlm/geometry/shape.h"

namespace hlm::geometry {

using AnyShape = std::variant<Shape, Mesh>;

/// What becomes of a mesh that is not convex.
enum class MeshUse : std::uint8_t {
  kPieces,  ///< A convex piece behind each triangle that has a width; of a sheet two, front and
            ///< back.
  kSolids,  ///< Solids, whatever its size: for what stands still.
};

/// A convex shape, or what is convex, is one piece.
struct ShapeParts {
  std::vector<Convex> pieces;
  std::vector<MeshSolid> solids;       ///< Then there are no pieces.
  std::unique_ptr<const Mesh> mesh;    ///< Whose skin the pieces are, or null;
  std::vector<const Mesh*> skins;      ///< by piece that, or its back,
  std::vector<std::size_t> triangles;  ///< and the triangle.

  bool is_skin() const noexcept { return mesh != nullptr; }
  /// Whether it is a mesh that is not convex.
  bool is_mesh() const noexcept { return is_skin() || !solids.empty(); }
  /// Triangles of the solids.
  std::size_t solid_triangles() const noexcept;
};

/// name: of a mesh, for messages. Throws std::runtime_error or std::invalid_argument with one line
/// if the shape cannot be used: an extent out of 1e-6 to 2e6 m, a mesh that repaired() refuses or
/// that is thin everywhere.
ShapeParts parts_of(AnyShape shape, const std::string& name, MeshUse use = MeshUse::kPieces);

}  // namespace hlm::geometry
