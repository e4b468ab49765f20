// The bodies of a Bullet world that a tool can push.
#pragma once

#include <cstdint>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/world_shapes.h"
#include "hlm/common/contact.h"

namespace hlm::bullet {

inline Matrix3 matrix_of(const btMatrix3x3& m) {
  Matrix3 result;
  for (int i = 0; i < 3; ++i) result.row(i) = vector_of(m[i]);
  return result;
}

/// What turning leaves the body's one shape as it is.
inline void set_roundness(const btRigidBody& body, MovableBody& to) {
  const btCollisionShape& shape = *body.getCollisionShape();
  int axis = 0;
  switch (shape.getShapeType()) {
    case SPHERE_SHAPE_PROXYTYPE:
      to.roundness = Roundness::kSphere;
      return;
    case CYLINDER_SHAPE_PROXYTYPE:
      axis = static_cast<const btCylinderShape&>(shape).getUpAxis();
      break;
    case CAPSULE_SHAPE_PROXYTYPE:
      axis = static_cast<const btCapsuleShape&>(shape).getUpAxis();
      break;
    default:
      return;
  }
  to.roundness = Roundness::kAxis;
  to.axis_W = matrix_of(body.getWorldTransform().getBasis()).col(axis).normalized();
}

/// The body in its present state, as if no joint held it.
inline MovableBody describe(const btRigidBody& body) {
  MovableBody found;
  found.id = number_of(body);
  found.p_WCom = vector_of(body.getCenterOfMassPosition());
  found.V_W << vector_of(body.getLinearVelocity()), vector_of(body.getAngularVelocity());
  const Vector3 moves = vector_of(body.getLinearFactor());
  const Vector3 turns = vector_of(body.getAngularFactor());
  const Matrix3 inverse_inertia = matrix_of(body.getInvInertiaTensorWorld());
  found.W.topLeftCorner<3, 3>() = (double{body.getInvMass()} * moves.cwiseAbs2()).asDiagonal();
  found.W.bottomRightCorner<3, 3>() = turns.asDiagonal() * inverse_inertia * turns.asDiagonal();
  found.W = 0.5 * (found.W + found.W.transpose().eval());  // Single precision leaves it askew.
  found.A_W.head<3>() = vector_of(body.getGravity()).cwiseProduct(moves);
  if (body.getNumConstraintRefs() == 0) set_roundness(body, found);
  return found;
}

/// The object of that number; null if it is not in the world.
inline btCollisionObject* find(btCollisionWorld& world, std::uint32_t number) {
  for (int i = 0; i < world.getNumCollisionObjects(); ++i) {
    btCollisionObject* object = world.getCollisionObjectArray()[i];
    if (number_of(*object) == number) return object;
  }
  return nullptr;
}

}  // namespace hlm::bullet
