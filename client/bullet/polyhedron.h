// The faces of a convex shape of Bullet, to clip them against each other.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include <BulletCollision/CollisionShapes/btConvexPolyhedron.h>
#include <BulletCollision/NarrowPhaseCollision/btPolyhedralContactClipping.h>
#include <btBulletCollisionCommon.h>

namespace hlm::bullet {

/// A point of one shape and its distance from a face of the other, m.
using FacePoints = std::vector<std::pair<btVector3, btScalar>>;

/// The vertices and faces of a box or a convex hull.
class Polyhedron {
 public:
  /// Null if the shape is neither.
  static std::unique_ptr<Polyhedron> of(const btCollisionShape& shape) {
    const bool box = shape.getShapeType() == BOX_SHAPE_PROXYTYPE;
    if (!box && shape.getShapeType() != CONVEX_HULL_SHAPE_PROXYTYPE) return nullptr;
    auto made = std::make_unique<Polyhedron>();
    const auto& convex = static_cast<const btPolyhedralConvexShape&>(shape);
    for (int i = 0; i < convex.getNumVertices(); ++i) {
      btVector3 vertex;
      convex.getVertex(i, vertex);
      made->hull_.addPoint(vertex, false);
    }
    made->hull_.initializePolyhedralFeatures();
    const btConvexPolyhedron& faces = *made->hull_.getConvexPolyhedron();
    for (int i = 0; i < faces.m_faces.size(); ++i) {
      const btScalar* plane = faces.m_faces[i].m_plane;
      made->normals_.emplace_back(plane[0], plane[1], plane[2]);
    }
    made->margin_ = box ? 0 : shape.getMargin();  // A box's vertices are on its margin.
    return made;
  }

  /// How far the surface is outside the faces, m.
  btScalar margin() const { return margin_; }

  /// Outer normals of the faces, shape's frame.
  const std::vector<btVector3>& normals() const { return normals_; }

  /// How far it reaches along `n`, with its margin, world, m.
  btScalar reach(const btTransform& X_WS, const btVector3& n) const {
    const btVector3 corner =
        hull_.localGetSupportingVertexWithoutMargin(X_WS.getBasis().transpose() * n);
    return n.dot(X_WS * corner) + margin_;
  }

  /// The corners and their distances from the plane through `p` with normal `n`, all in the world.
  FacePoints above(const btVector3& p, const btVector3& n, const btTransform& X_WS) const {
    FacePoints found;
    for (int i = 0; i < hull_.getNumPoints(); ++i) {
      const btVector3 corner = X_WS * hull_.getUnscaledPoints()[i];
      found.emplace_back(corner, n.dot(corner - p));
    }
    return found;
  }

  /// Corners of the part of `other`'s face that lies over the face of this whose normal is nearest
  /// to `n`, and their distances from that, up to `reach`. All in the world.
  FacePoints over(const btTransform& X_WS, const btVector3& n, const Polyhedron& other,
                  const btTransform& X_WO, btScalar reach) const {
    struct Clipped : btDiscreteCollisionDetectorInterface::Result {
      void setShapeIdentifiersA(int, int) override {}
      void setShapeIdentifiersB(int, int) override {}
      void addContactPoint(const btVector3&, const btVector3& point, btScalar distance) override {
        points.emplace_back(point, distance);
      }
      FacePoints points;
    } clipped;
    btVertexArray face, swapped;
    btPolyhedralContactClipping::clipHullAgainstHull(
        -n, *hull_.getConvexPolyhedron(), *other.hull_.getConvexPolyhedron(), X_WS, X_WO,
        -BT_LARGE_FLOAT, reach, face, swapped, clipped);
    return clipped.points;
  }

 private:
  btConvexHullShape hull_;
  std::vector<btVector3> normals_;
  btScalar margin_ = 0;
};

}  // namespace hlm::bullet
