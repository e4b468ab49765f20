// The objects of a Bullet world as the server takes them, and which of them are near the tool.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/shapes.h"
#include "hlm/client/haptic_client.h"
#include "hlm/common/contact.h"

namespace hlm::bullet {

inline Vector3 vector_of(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
inline Pose pose_of(const btTransform& X) {
  const btQuaternion R = X.getRotation();
  return {vector_of(X.getOrigin()), Quaternion(R.w(), R.x(), R.y(), R.z()).normalized()};
}

/// The world's number for an object, the same while the object is in the world.
inline std::uint32_t number_of(const btCollisionObject& object) {
  return static_cast<std::uint32_t>(object.getBroadphaseHandle()->m_uniqueId);
}

/// The object as a body, if forces move it; null otherwise.
inline btRigidBody* movable(btCollisionObject& object) {
  btRigidBody* body = btRigidBody::upcast(&object);
  return body != nullptr && !body->isStaticOrKinematicObject() ? body : nullptr;
}

/// Bullet's shapes and transforms. What stands still is one surface.
class WorldShapes {
 public:
  /// An object that moves.
  struct Moving {
    btCollisionObject* object;
    double gap;  ///< Between its box and the tool's, m; 0: they overlap.
  };

  /// The world must outlive this.
  WorldShapes(btCollisionWorld& world, const btCollisionObject& tool)
      : world_(world), tool_(tool) {}

  /// Gives them to the server, again where objects or their shapes have come, gone or changed.
  /// Throws std::invalid_argument, which names the object, if a shape cannot be used.
  /// gravity_of: what a body's weight accelerates it by.
  template <class Gravity>
  void offer(HapticClient& client, const Gravity& gravity_of) {
    std::vector<Source> now = sources();
    if (is_offered_ && now == sources_) return;
    protocol::SceneOffer offer;
    std::vector<const Source*> source_of;
    for (const Source& source : now) {
      for (const PlacedShape& placed : shapes_of(source)) {
        offer.shapes.push_back(offered(source, placed));
        source_of.push_back(&source);
      }
    }
    for (std::uint32_t i = 0; i < source_of.size(); ++i) {
      for (std::uint32_t j = 0; j < i; ++j) {
        if (are_apart(*source_of[i], *source_of[j])) offer.apart.emplace_back(j, i);
      }
    }
    add_inertias(now, gravity_of, offer);
    client.offer_scene(std::move(offer));
    sources_ = std::move(now);
    is_offered_ = true;
  }

  /// All but the tool, the nearest to it first.
  std::vector<Moving> moving() const {
    std::vector<Moving> found;
    for (int i = 0; i < world_.getNumCollisionObjects(); ++i) {
      btCollisionObject* object = world_.getCollisionObjectArray()[i];
      if (object == &tool_ || object->isStaticObject()) continue;
      found.push_back({object, gap_between(*object, tool_)});
    }
    std::ranges::stable_sort(found, {}, &Moving::gap);
    return found;
  }

  /// Where they are, and how they move.
  static BodyPoses poses_of(const std::vector<Moving>& objects) {
    BodyPoses poses;
    for (const Moving& moving : objects) {
      if (poses.size() == poses.capacity()) break;
      BodyPose& pose = poses.emplace_back();
      pose.body = number_of(*moving.object);
      pose.X_WB = pose_of(moving.object->getWorldTransform());
      const btRigidBody* body = btRigidBody::upcast(moving.object);
      if (body == nullptr) continue;
      pose.V_W << vector_of(body->getLinearVelocity()), vector_of(body->getAngularVelocity());
    }
    return poses;
  }

 private:
  /// What the server's shapes of an object depend on.
  struct Source {
    std::uint32_t number;
    btCollisionObject* object;
    const btCollisionShape* shape;
    int revision;  ///< Of compounds, whose parts may change.
    std::array<btScalar, 3> scaling;
    std::array<int, 2> filter;  ///< Group and mask.
    btScalar friction;
    bool responds;  ///< It makes force; of the tool, whether or not.
    bool moves;
    bool jointed;                    ///< One of the world's constraints is on it.
    std::array<btScalar, 12> place;  ///< Of what stands still.
    auto operator<=>(const Source&) const = default;
  };

  static int revision_of(const btCollisionShape& shape) {
    if (!shape.isCompound()) return 0;
    const auto& parts = static_cast<const btCompoundShape&>(shape);
    int revision = parts.getUpdateRevision();
    for (int i = 0; i < parts.getNumChildShapes(); ++i) {
      revision += revision_of(*parts.getChildShape(i));
    }
    return revision;
  }

  static double gap_between(const btCollisionObject& a, const btCollisionObject& b) {
    btVector3 low_a, high_a, low_b, high_b;
    a.getCollisionShape()->getAabb(a.getWorldTransform(), low_a, high_a);
    b.getCollisionShape()->getAabb(b.getWorldTransform(), low_b, high_b);
    btVector3 gap(0, 0, 0);
    gap.setMax(low_a - high_b);
    gap.setMax(low_b - high_a);
    return double{gap.length()};
  }

  std::set<const btCollisionObject*> jointed_objects() const {
    std::set<const btCollisionObject*> jointed;
    auto* world = dynamic_cast<btDynamicsWorld*>(&world_);
    for (int i = 0; world != nullptr && i < world->getNumConstraints(); ++i) {
      jointed.insert(&world->getConstraint(i)->getRigidBodyA());
      jointed.insert(&world->getConstraint(i)->getRigidBodyB());
    }
    return jointed;
  }

  std::vector<Source> sources() const {
    const std::set<const btCollisionObject*> jointed = jointed_objects();
    std::vector<Source> sources;
    for (int i = 0; i < world_.getNumCollisionObjects(); ++i) {
      btCollisionObject* object = world_.getCollisionObjectArray()[i];
      const btCollisionShape* shape = object->getCollisionShape();
      const btVector3& scaling = shape->getLocalScaling();
      const btBroadphaseProxy& proxy = *object->getBroadphaseHandle();
      Source& source =
          sources.emplace_back(Source{number_of(*object),
                                      object,
                                      shape,
                                      revision_of(*shape),
                                      {scaling.x(), scaling.y(), scaling.z()},
                                      {proxy.m_collisionFilterGroup, proxy.m_collisionFilterMask},
                                      object->getFriction(),
                                      object == &tool_ || object->hasContactResponse(),
                                      !object->isStaticObject(),
                                      !object->isStaticObject() && jointed.contains(object),
                                      {}});
      if (source.moves) continue;
      const btTransform& X = object->getWorldTransform();
      for (int k = 0; k < 3; ++k) {
        const auto row = static_cast<std::size_t>(4 * k);
        source.place[row] = X.getOrigin()[k];
        for (int m = 0; m < 3; ++m) {
          source.place[row + 1 + static_cast<std::size_t>(m)] = X.getBasis()[k][m];
        }
      }
    }
    std::ranges::sort(sources);
    return sources;
  }

  static std::vector<PlacedShape> shapes_of(const Source& source) {
    std::vector<PlacedShape> placed;
    try {
      add_shapes(*source.shape, btTransform::getIdentity(), placed);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("object " + std::to_string(source.number) + ": " + error.what());
    }
    return placed;
  }

  protocol::OfferedShape offered(const Source& source, const PlacedShape& placed) const {
    protocol::OfferedShape shape;
    shape.shape = placed.shape;
    shape.X_BS =
        pose_of(source.moves ? placed.X_OS : source.object->getWorldTransform() * placed.X_OS);
    shape.friction = {double{source.friction}, FrictionRule::kProduct};
    if (source.object == &tool_) {
      shape.side = {SideKind::kToolLink, 0};
    } else if (source.moves) {
      shape.side = {SideKind::kMovableBody, source.number};
    }
    return shape;
  }

  /// Of the bodies that forces move and the server can: neither a joint nor one of Bullet's factors
  /// holds them.
  template <class Gravity>
  void add_inertias(const std::vector<Source>& sources, const Gravity& gravity_of,
                    protocol::SceneOffer& offer) const {
    const btVector3 one(1, 1, 1);
    for (const Source& source : sources) {
      const btRigidBody* body = movable(*source.object);
      if (body == nullptr || source.object == &tool_ || source.jointed) continue;
      if (body->getLinearFactor() != one || body->getAngularFactor() != one) continue;
      if (body->getLinearDamping() >= 1 || body->getAngularDamping() >= 1) continue;
      const btVector3& turns = body->getInvInertiaDiagLocal();
      if (turns.x() <= 0 || turns.y() <= 0 || turns.z() <= 0) continue;
      BodyInertia& to = offer.inertias.emplace_back();
      to.body = source.number;
      to.mass = 1 / double{body->getInvMass()};
      to.I_BCom = vector_of(body->getLocalInertia()).asDiagonal();
      to.gravity_W = vector_of(gravity_of(*body));
      to.damping = -std::log1p(-double{body->getLinearDamping()});  // Shares lost in a second.
      to.angular_damping = -std::log1p(-double{body->getAngularDamping()});
    }
  }

  static bool are_apart(const Source& a, const Source& b) {
    if (a.object == b.object || (!a.moves && !b.moves)) return false;  // They never touch.
    const bool meet = (a.filter[0] & b.filter[1]) != 0 && (b.filter[0] & a.filter[1]) != 0;
    return !meet || !a.responds || !b.responds || !a.object->checkCollideWith(b.object) ||
           !b.object->checkCollideWith(a.object);
  }

  btCollisionWorld& world_;
  const btCollisionObject& tool_;
  std::vector<Source> sources_;
  bool is_offered_ = false;
};

}  // namespace hlm::bullet
