// Shapes and poses of the C interface as the C++ libraries have them.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

#include <haptic.h>

#include "hlm/protocol/scene_offer.h"

namespace hlm {

inline Pose pose_of(const double (&p)[3], const double (&R)[4]) {
  return {Eigen::Map<const Vector3>(p), Quaternion(R[0], R[1], R[2], R[3])};
}
inline Pose pose_of(const haptic_pose& from) { return pose_of(from.position, from.rotation); }

/// How many sizes a kind of shape has.
inline std::ptrdiff_t sizes_of(protocol::SceneShapeKind kind) {
  using Kind = protocol::SceneShapeKind;
  switch (kind) {
    case Kind::kSphere:
      return 1;
    case Kind::kCapsule:
    case Kind::kCylinder:
      return 2;
    case Kind::kBox:
    case Kind::kEllipsoid:
      return 3;
    case Kind::kHull:
    case Kind::kHalfSpace:
    case Kind::kMesh:
      return 0;
  }
  return 0;
}

inline void require_at_most(std::size_t most, std::size_t count, const char* name) {
  if (count <= most) return;
  throw std::invalid_argument(std::to_string(count) + " " + name + " must be at most " +
                              std::to_string(most));
}

inline protocol::SceneShape shape_of(const haptic_shape& from) {
  if (from.kind < HAPTIC_SPHERE || from.kind > HAPTIC_MESH) {
    throw std::invalid_argument("kind " + std::to_string(from.kind) + " must be 0 to 7");
  }
  protocol::SceneShape shape{.kind = static_cast<protocol::SceneShapeKind>(from.kind)};
  const std::ptrdiff_t sizes = sizes_of(shape.kind);
  shape.size.head(sizes) = Eigen::Map<const Vector3>(from.size).head(sizes);
  const bool has_triangles = from.kind == HAPTIC_MESH;
  if (!has_triangles && from.kind != HAPTIC_HULL) return shape;
  constexpr protocol::SceneLimits kLimits;
  require_at_most(kLimits.vertices, from.vertex_count, "vertices");
  if (from.vertices == nullptr) throw std::invalid_argument("it must have vertices");
  for (std::size_t i = 0; i < from.vertex_count; ++i) {
    shape.vertices.emplace_back(Eigen::Map<const Vector3>(from.vertices + 3 * i));
  }
  if (!has_triangles) {
    if (from.vertex_count >= 4) return shape;
    throw std::invalid_argument("a hull of " + std::to_string(from.vertex_count) +
                                " points; at least 4 are needed");
  }
  require_at_most(kLimits.triangles, from.triangle_count, "triangles");
  if (from.triangles == nullptr) throw std::invalid_argument("a mesh must have triangles");
  for (std::size_t i = 0; i < from.triangle_count; ++i) {
    const std::uint32_t* corners = from.triangles + 3 * i;
    shape.triangles.push_back({corners[0], corners[1], corners[2]});
  }
  return shape;
}

/// Shape `place` of those that are offered. Throws std::invalid_argument that names it.
inline protocol::OfferedShape offered_shape(std::size_t place, const haptic_shape& from,
                                            const haptic_pose& pose,
                                            const haptic_material& material) {
  try {
    if (from.side < HAPTIC_WORLD || from.side > HAPTIC_MOVABLE_BODY) {
      throw std::invalid_argument("side " + std::to_string(from.side) + " must be 0 to 2");
    }
    if (material.rule < HAPTIC_AVERAGE || material.rule > HAPTIC_MAXIMUM) {
      throw std::invalid_argument("rule " + std::to_string(material.rule) + " must be 0 to 3");
    }
    if (material.priority < 0 || material.priority > 255) {
      throw std::invalid_argument("priority " + std::to_string(material.priority) +
                                  " must be 0 to 255");
    }
    return {.shape = shape_of(from),
            .side = {static_cast<SideKind>(from.side), from.index},
            .X_BS = pose_of(pose),
            .friction = {material.friction, static_cast<FrictionRule>(material.rule),
                         static_cast<std::uint8_t>(material.priority)},
            .group = from.group,
            .mask = from.mask};
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("shape " + std::to_string(place) + ": " + error.what());
  }
}

}  // namespace hlm
