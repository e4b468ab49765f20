#include "hlm/haptic_server/scene/scene_shapes.h"

#include <cstdlib>

namespace hlm::server {
namespace {

geometry::Mesh mesh_of(const protocol::SceneShape& shape) {
  geometry::Mesh mesh;
  mesh.points = shape.vertices;
  for (const auto& [a, b, c] : shape.triangles) {
    mesh.triangles.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
  }
  return mesh;
}

}  // namespace

geometry::AnyShape any_shape(const protocol::SceneShape& shape) {
  using protocol::SceneShapeKind;
  const Vector3& size = shape.size;
  switch (shape.kind) {
    case SceneShapeKind::kSphere:
      return geometry::Sphere{size.x()};
    case SceneShapeKind::kCapsule:
      return geometry::Capsule{size.x(), size.y()};
    case SceneShapeKind::kCylinder:
      return geometry::Cylinder{size.x(), size.y()};
    case SceneShapeKind::kBox:
      return geometry::Box{size};
    case SceneShapeKind::kEllipsoid:
      return geometry::Ellipsoid{size};
    case SceneShapeKind::kHull:
      return geometry::Hull{shape.vertices};
    case SceneShapeKind::kHalfSpace:
      return geometry::HalfSpace{};
    case SceneShapeKind::kMesh:
      return mesh_of(shape);
  }
  std::abort();
}

}  // namespace hlm::server
