// The contacts of the tool and of the bodies near it in a Bullet world, also before they touch.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/shapes.h"
#include "hlm/client/haptic_contact.h"
#include "hlm/common/contact.h"

namespace hlm::bullet {

inline Vector3 vector_of(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

/// The world's number for an object, the same while the object is in the world.
inline std::uint32_t number_of(const btCollisionObject& object) {
  return static_cast<std::uint32_t>(object.getBroadphaseHandle()->m_uniqueId);
}

/// The object as a body, if forces move it; null otherwise.
inline btRigidBody* movable(btCollisionObject& object) {
  btRigidBody* body = btRigidBody::upcast(&object);
  return body != nullptr && !body->isStaticOrKinematicObject() ? body : nullptr;
}

/// Contacts within ε by haptic_proximity.h, from Bullet's shapes and transforms. What stands still
/// is one surface.
class NearContacts {
 public:
  /// The world must outlive this. `tool`: side a of its contacts. `epsilon`: ε, m.
  NearContacts(btCollisionWorld& world, const btCollisionObject& tool, double epsilon)
      : world_(world), tool_(tool), epsilon_(epsilon) {}

  /// Contacts of the tool, and then of the bodies near it, at the present transforms; b.index is
  /// the other's number. Without velocities and loads. Throws std::invalid_argument if a shape
  /// cannot be used. Where objects or their shapes have come or gone, all is arranged anew, which
  /// may take a while for large meshes.
  std::vector<ReportedContact> find() {
    arrange();
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const btTransform X_WS = parts_[i].object->getWorldTransform() * parts_[i].X_OS;
      const btQuaternion R = X_WS.getRotation();
      const btVector3& p = X_WS.getOrigin();
      poses_[i] = {{double{p.x()}, double{p.y()}, double{p.z()}},
                   {double{R.w()}, double{R.x()}, double{R.y()}, double{R.z()}}};
    }
    const std::size_t count = haptic_proximity_find(proximity_.get(), poses_.data(), epsilon_,
                                                    found_.data(), shapes_.data());
    std::vector<ReportedContact> contacts;
    for (std::size_t i = 0; i < count; ++i) {
      const btCollisionObject& a = *parts_[shapes_[2 * i]].object;
      const btCollisionObject& b = *parts_[shapes_[2 * i + 1]].object;
      if (!may_collide(a, b)) continue;  // It may have changed.
      contacts.push_back(contact_of(found_[i]));
      contacts.back().friction = double{btManifoldResult::calculateCombinedFriction(&a, &b)};
    }
    return contacts;
  }

 private:
  /// A shape of an object.
  struct Part {
    btCollisionObject* object;
    btTransform X_OS;
  };
  /// What the shapes depend on.
  struct Source {
    std::uint32_t number;
    btCollisionObject* object;
    const btCollisionShape* shape;
    int revision;  ///< Of compounds, whose parts may change.
    std::array<btScalar, 3> scaling;
    std::array<int, 2> filter;  ///< Group and mask.
    bool responds;              ///< It makes force; of the tool, whether or not.
    bool movable;
    auto operator<=>(const Source&) const = default;
  };

  static bool may_collide(const btCollisionObject& a, const btCollisionObject& b) {
    return passes_filter(a, b) && a.checkCollideWith(&b) && b.checkCollideWith(&a);
  }

  /// By what stands in Source.
  static bool passes_filter(const btCollisionObject& a, const btCollisionObject& b) {
    const btBroadphaseProxy& in_a = *a.getBroadphaseHandle();
    const btBroadphaseProxy& in_b = *b.getBroadphaseHandle();
    return &a != &b && b.hasContactResponse() &&
           (in_a.m_collisionFilterGroup & in_b.m_collisionFilterMask) != 0 &&
           (in_b.m_collisionFilterGroup & in_a.m_collisionFilterMask) != 0;
  }

  static int revision_of(const btCollisionShape& shape) {
    if (!shape.isCompound()) return 0;
    const auto& parts = static_cast<const btCompoundShape&>(shape);
    int revision = parts.getUpdateRevision();
    for (int i = 0; i < parts.getNumChildShapes(); ++i) {
      revision += revision_of(*parts.getChildShape(i));
    }
    return revision;
  }

  std::vector<Source> sources() const {
    std::vector<Source> sources;
    for (int i = 0; i < world_.getNumCollisionObjects(); ++i) {
      btCollisionObject* object = world_.getCollisionObjectArray()[i];
      const btCollisionShape* shape = object->getCollisionShape();
      const btVector3& scaling = shape->getLocalScaling();
      const btBroadphaseProxy& proxy = *object->getBroadphaseHandle();
      sources.push_back({number_of(*object),
                         object,
                         shape,
                         revision_of(*shape),
                         {scaling.x(), scaling.y(), scaling.z()},
                         {proxy.m_collisionFilterGroup, proxy.m_collisionFilterMask},
                         object == &tool_ || object->hasContactResponse(),
                         movable(*object) != nullptr});
    }
    std::ranges::sort(sources);
    return sources;
  }

  void arrange() {
    std::vector<Source> now = sources();
    if (proximity_ && now == sources_) return;
    proximity_.reset();
    sources_ = std::move(now);
    parts_.clear();
    std::vector<PlacedShape> placed;
    for (const Source& source : sources_) {
      const std::size_t first = placed.size();
      try {
        add_shapes(*source.shape, btTransform::getIdentity(), placed);
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument("object " + std::to_string(source.number) + ": " +
                                    error.what());
      }
      for (std::size_t i = first; i < placed.size(); ++i) {
        haptic_shape& shape = placed[i].shape;
        shape.side = source.object == &tool_ ? HAPTIC_TOOL_LINK
                     : source.movable        ? HAPTIC_MOVABLE_BODY
                                             : HAPTIC_WORLD;
        shape.index = source.object == &tool_ ? 0 : source.number;
        shape.group = shape.mask = 1;
        parts_.push_back({source.object, placed[i].X_OS});
      }
    }
    std::vector<haptic_shape> shapes;
    for (const PlacedShape& one : placed) {
      haptic_shape& shape = shapes.emplace_back(one.shape);
      shape.vertices = one.vertices.data();
      shape.vertex_count = static_cast<std::uint32_t>(one.vertices.size() / 3);
      shape.triangles = one.triangles.data();
      shape.triangle_count = one.triangles.size() / 3;
    }
    const std::vector<std::uint32_t> excluded = apart(shapes);
    char error[512] = "";
    proximity_.reset(haptic_proximity_open(shapes.data(), shapes.size(), excluded.data(),
                                           excluded.size() / 2, error, sizeof error));
    if (!proximity_) throw std::invalid_argument(error);
    poses_.resize(parts_.size());
  }

  /// Pairs of shapes of which one is the tool's or a body's, and that never touch.
  std::vector<std::uint32_t> apart(const std::vector<haptic_shape>& shapes) const {
    std::vector<std::uint32_t> pairs;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      if (shapes[i].side == HAPTIC_WORLD) continue;
      for (std::size_t j = 0; j < shapes.size(); ++j) {
        const btCollisionObject& a = *parts_[i].object;
        const btCollisionObject& b = *parts_[j].object;
        const bool of_tool =
            shapes[j].side == HAPTIC_TOOL_LINK;  // Then it is the first of another pair.
        if (&a == &b || of_tool || passes_filter(a, b)) continue;
        pairs.push_back(static_cast<std::uint32_t>(i));
        pairs.push_back(static_cast<std::uint32_t>(j));
      }
    }
    return pairs;
  }

  struct Close {
    void operator()(haptic_proximity* proximity) const { haptic_proximity_close(proximity); }
  };

  btCollisionWorld& world_;
  const btCollisionObject& tool_;
  double epsilon_;
  std::vector<Source> sources_;
  std::vector<Part> parts_;
  std::vector<haptic_pose> poses_;
  std::unique_ptr<haptic_proximity, Close> proximity_;
  std::array<haptic_contact, HAPTIC_MAX_CONTACTS> found_;
  std::array<std::uint32_t, 2 * HAPTIC_MAX_CONTACTS> shapes_;
};

}  // namespace hlm::bullet
