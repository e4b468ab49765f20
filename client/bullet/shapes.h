// The shapes of a Bullet world as a server takes them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <BulletCollision/CollisionShapes/btConvexPolyhedron.h>
#include <btBulletCollisionCommon.h>

#include "hlm/protocol/scene_records.h"

namespace hlm::bullet {

/// A shape, and where it is in its object.
struct PlacedShape {
  protocol::SceneShape shape = {};
  btTransform X_OS = btTransform::getIdentity();

  void add(const btVector3& vertex) {
    shape.vertices.emplace_back(double{vertex.x()}, double{vertex.y()}, double{vertex.z()});
  }
};

namespace detail {

/// A turn that brings z onto the shape's axis of that number.
inline btQuaternion along(int axis) {
  if (axis == 2) return btQuaternion::getIdentity();
  const btVector3 about = axis == 0 ? btVector3(0, 1, 0) : btVector3(-1, 0, 0);
  return {about, SIMD_HALF_PI};
}

/// Of a convex hull whose surface is a margin outside of its faces: the faces there. Its edges are
/// round in Bullet, and cut off here.
inline void add_hull(const btPolyhedralConvexShape& shape, PlacedShape& to) {
  btConvexHullShape hull;
  for (int i = 0; i < shape.getNumVertices(); ++i) {
    btVector3 vertex;
    shape.getVertex(i, vertex);
    hull.addPoint(vertex, false);
  }
  if (!hull.initializePolyhedralFeatures()) throw std::invalid_argument("a hull is degenerate");
  const btConvexPolyhedron& faces = *hull.getConvexPolyhedron();
  for (int i = 0; i < faces.m_faces.size(); ++i) {
    const btFace& face = faces.m_faces[i];
    const btVector3 n(face.m_plane[0], face.m_plane[1], face.m_plane[2]);
    for (int j = 0; j < face.m_indices.size(); ++j) {
      to.add(faces.m_vertices[face.m_indices[j]] + shape.getMargin() * n);
    }
  }
}

/// Of any other convex shape: where it ends in some hundred directions that are evenly spread, and
/// along the axes.
inline void add_outermost(const btConvexShape& shape, PlacedShape& to) {
  constexpr int kDirections = 400;
  constexpr double kGoldenAngle = 2.39996322972865332;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2 * i + 1.0) / kDirections;
    const double r = std::sqrt(1 - z * z);
    to.add(shape.localGetSupportingVertex({static_cast<btScalar>(r * std::cos(i * kGoldenAngle)),
                                           static_cast<btScalar>(r * std::sin(i * kGoldenAngle)),
                                           static_cast<btScalar>(z)}));
  }
  for (int axis = 0; axis < 3; ++axis) {
    btVector3 direction(0, 0, 0);
    for (const btScalar sign : {btScalar(1), btScalar(-1)}) {
      direction[axis] = sign;
      to.add(shape.localGetSupportingVertex(direction));
    }
  }
}

/// Triangles of a mesh or a height field.
inline void add_triangles(const btConcaveShape& shape, PlacedShape& to) {
  struct Triangles : btTriangleCallback {
    explicit Triangles(PlacedShape& to) : to_(to) {}
    void processTriangle(btVector3* corners, int, int) override {
      const auto first = static_cast<std::uint32_t>(to_.shape.vertices.size());
      to_.shape.triangles.push_back({first, first + 1, first + 2});
      for (int i = 0; i < 3; ++i) to_.add(corners[i]);
    }
    PlacedShape& to_;
  } triangles(to);
  btVector3 low, high;
  shape.getAabb(btTransform::getIdentity(), low, high);
  shape.processAllTriangles(&triangles, low, high);
}

}  // namespace detail

/// Adds what stands for a shape that is at X_OS in its object: one for each part of a compound.
inline void add_shapes(const btCollisionShape& shape, const btTransform& X_OS,
                       std::vector<PlacedShape>& to) {
  if (shape.getShapeType() == EMPTY_SHAPE_PROXYTYPE) return;
  if (shape.isCompound()) {
    const auto& parts = static_cast<const btCompoundShape&>(shape);
    for (int i = 0; i < parts.getNumChildShapes(); ++i) {
      add_shapes(*parts.getChildShape(i), X_OS * parts.getChildTransform(i), to);
    }
    return;
  }
  PlacedShape& made = to.emplace_back();
  made.X_OS = X_OS;
  using Kind = protocol::SceneShapeKind;
  protocol::SceneShape& is = made.shape;
  const auto turn_to = [&](int axis) {
    made.X_OS.setRotation(X_OS.getRotation() * detail::along(axis));
  };
  switch (shape.getShapeType()) {
    case SPHERE_SHAPE_PROXYTYPE:
      is.kind = Kind::kSphere;
      is.size[0] = double{static_cast<const btSphereShape&>(shape).getRadius()};
      break;
    case BOX_SHAPE_PROXYTYPE: {
      const btVector3 half = static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin();
      is.kind = Kind::kBox;
      for (int i = 0; i < 3; ++i) is.size[i] = 2 * double{half[i]};
      break;
    }
    case CAPSULE_SHAPE_PROXYTYPE: {
      const auto& capsule = static_cast<const btCapsuleShape&>(shape);
      is.kind = Kind::kCapsule;
      is.size[0] = double{capsule.getRadius()};
      is.size[1] = 2 * double{capsule.getHalfHeight()};
      turn_to(capsule.getUpAxis());
      break;
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const auto& cylinder = static_cast<const btCylinderShape&>(shape);
      is.kind = Kind::kCylinder;
      is.size[0] = double{cylinder.getRadius()};
      is.size[1] = 2 * double{cylinder.getHalfExtentsWithMargin()[cylinder.getUpAxis()]};
      turn_to(cylinder.getUpAxis());
      break;
    }
    case STATIC_PLANE_PROXYTYPE: {
      const auto& plane = static_cast<const btStaticPlaneShape&>(shape);
      const btVector3& n = plane.getPlaneNormal();
      is.kind = Kind::kHalfSpace;
      made.X_OS = X_OS * btTransform(shortestArcQuat({0, 0, 1}, n), plane.getPlaneConstant() * n);
      break;
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE:
      is.kind = Kind::kHull;
      detail::add_hull(static_cast<const btConvexHullShape&>(shape), made);
      break;
    default:
      if (shape.isConvex()) {
        is.kind = Kind::kHull;
        detail::add_outermost(static_cast<const btConvexShape&>(shape), made);
      } else if (shape.isConcave()) {
        is.kind = Kind::kMesh;
        detail::add_triangles(static_cast<const btConcaveShape&>(shape), made);
      } else {
        throw std::invalid_argument(std::string("a shape of kind ") + shape.getName() +
                                    " must be convex, concave or a compound");
      }
  }
}

}  // namespace hlm::bullet
