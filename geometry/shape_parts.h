// The convex pieces that stand for a shape.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "hlm/geometry/convex.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"

namespace hlm::geometry {

using AnyShape = std::variant<Shape, Mesh>;

/// A convex shape, or what is convex, is one piece. Of any other mesh there is one behind each
/// triangle that has a width; of a sheet two, front and back.
struct ShapeParts {
  std::vector<Convex> pieces;
  std::unique_ptr<const Mesh> mesh;    ///< Whose skin the pieces are, or null;
  std::vector<const Mesh*> skins;      ///< by piece that, or its back,
  std::vector<std::size_t> triangles;  ///< and the triangle.

  bool is_skin() const noexcept { return mesh != nullptr; }
};

/// name: of a mesh, for messages. Throws std::runtime_error or std::invalid_argument with one line
/// if the shape cannot be used: an extent out of 1e-6 to 2e6 m, a mesh that repaired() refuses or
/// that is thin everywhere.
ShapeParts parts_of(AnyShape shape, const std::string& name);

}  // namespace hlm::geometry
