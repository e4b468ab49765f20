// The bodies of a Bullet world that a tool can push.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/joints.h"
#include "hlm/client/bullet/world_shapes.h"
#include "hlm/common/contact.h"

namespace hlm::bullet {

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

/// The body, one of `jointed`, in its present state, with what its joints leave of its mobility.
inline MovableBody describe(const btRigidBody& body, const JointedBodies& jointed) {
  MovableBody found;
  found.id = number_of(body);
  found.p_WCom = vector_of(body.getCenterOfMassPosition());
  found.V_W << vector_of(body.getLinearVelocity()), vector_of(body.getAngularVelocity());
  found.W = jointed.inverse_inertia(body);
  found.A_W = jointed.acceleration(body);
  if (!jointed.has_joints()) set_roundness(body, found);
  return found;
}

/// Adds what touches one of the bodies, and what touches that, and so on, but for the tool: what
/// lies on a body moves with it.
inline void add_touching(btDynamicsWorld& world, const btRigidBody& tool,
                         std::vector<btRigidBody*>& bodies) {
  btDispatcher& pairs = *world.getDispatcher();
  for (std::size_t known = 0; known < bodies.size(); ++known) {
    for (int i = 0; i < pairs.getNumManifolds(); ++i) {
      const btPersistentManifold& pair = *pairs.getManifoldByIndexInternal(i);
      const bool first = pair.getBody0() == bodies[known];
      if (pair.getNumContacts() == 0 || (!first && pair.getBody1() != bodies[known])) continue;
      btCollisionObject* other = const_cast<btCollisionObject*>(first ? pair.getBody1()  // NOLINT
                                                                      : pair.getBody0());
      btRigidBody* body = movable(*other);
      if (body == nullptr || body == &tool) continue;
      if (std::ranges::find(bodies, body) == bodies.end()) bodies.push_back(body);
    }
  }
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
