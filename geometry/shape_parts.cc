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
/// Most corners of a mesh that becomes solids and may be convex: a hull of more is no better.
constexpr std::size_t kMostOfHull = 256;

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

std::size_t ShapeParts::solid_triangles() const noexcept {
  std::size_t count = 0;
  for (const MeshSolid& solid : solids) count += solid.triangles().size();
  return count;
}

ShapeParts parts_of(AnyShape shape, const std::string& name, MeshUse use) {
  ShapeParts parts;
  if (const auto* convex = std::get_if<Shape>(&shape)) {
    require_usable_size(parts.pieces.emplace_back(*convex));
    return parts;
  }
  std::vector<std::string> repairs;  // Nobody to tell.
  const bool to_solids = use == MeshUse::kSolids;
  auto mesh = std::make_unique<const Mesh>(repaired(std::get<Mesh>(std::move(shape)), name, repairs,
                                                    to_solids ? kMostOfSolids : kMostTriangles));
  const bool may_be_hull = !to_solids || mesh->points.size() <= kMostOfHull;
  if (may_be_hull && is_convex(*mesh)) {
    parts.pieces.emplace_back(Hull{mesh->points});
    return parts;
  }
  if (to_solids) {
    parts.solids = solids_of(*mesh);
    return parts;
  }
  add_skin(*mesh, parts);
  if (mesh->back) add_skin(*mesh->back, parts);
  if (parts.pieces.empty()) throw std::invalid_argument("a mesh is thinner than 1e-6 m everywhere");
  parts.mesh = std::move(mesh);
  return parts;
}

}  // namespace hlm::geometry
