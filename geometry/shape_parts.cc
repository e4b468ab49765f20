#include "hlm/geometry/shape_parts.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "hlm/common/range.h"
#include "hlm/geometry/hull.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/mesh_pieces.h"

namespace hlm::geometry {
namespace {

/// Extents of shapes, m.
constexpr double kSmallest = 1e-6;
constexpr double kLargest = 2e6;

void require_usable_size(const Convex& convex) {
  if (convex.is_half_space()) return;
  const Vector3 extents = convex.bounds(Pose{}).sizes();
  for (const double extent : {extents.minCoeff(), extents.maxCoeff()}) {
    if (extent >= kSmallest && extent <= kLargest) continue;
    throw std::invalid_argument("its extent " + shortest_text(extent) + " m must be 1e-6 to 2e6 m");
  }
}

/// Triangles without a width are left out: their neighbours go on.
void add_skin(const Mesh& mesh, ShapeParts& parts) {
  const std::vector<Hull> skin = skin_of(mesh);
  for (std::size_t i = 0; i < skin.size(); ++i) {
    interruption_point();
    if (!has_inside(skin[i].vertices)) continue;
    parts.pieces.emplace_back(skin[i]);
    parts.skins.push_back(&mesh);
    parts.triangles.push_back(i);
  }
}

}  // namespace

ShapeParts parts_of(AnyShape shape, const std::string& name) {
  ShapeParts parts;
  if (const auto* convex = std::get_if<Shape>(&shape)) {
    require_usable_size(parts.pieces.emplace_back(*convex));
    return parts;
  }
  std::vector<std::string> repairs;  // Nobody to tell.
  auto mesh =
      std::make_unique<const Mesh>(repaired(std::get<Mesh>(std::move(shape)), name, repairs));
  if (is_convex(*mesh)) {
    parts.pieces.emplace_back(Hull{mesh->points});
    return parts;
  }
  add_skin(*mesh, parts);
  if (mesh->back) add_skin(*mesh->back, parts);
  if (parts.pieces.empty()) throw std::invalid_argument("a mesh is thinner than 1e-6 m everywhere");
  parts.mesh = std::move(mesh);
  return parts;
}

}  // namespace hlm::geometry
