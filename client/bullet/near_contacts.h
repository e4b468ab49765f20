// The contacts of an object of a Bullet world, also before they touch.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/polyhedron.h"
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

/// What the object is to a server.
inline ContactSide side_of(btCollisionObject& object) {
  return {movable(object) != nullptr ? SideKind::kMovableBody : SideKind::kWorld,
          number_of(object)};
}

/// Contacts within ε, by Bullet's closest points. Where a face of a box or a convex hull takes
/// part, of which Bullet gives one point, the faces are clipped: all their corners are found. Other
/// shapes have one contact in each pair. Compounds and meshes are pairs of their parts.
class NearContacts {
 public:
  /// The world must outlive this, and shapes must not change. `epsilon`: ε, m.
  NearContacts(btCollisionWorld& world, double epsilon)
      : world_(world), epsilon_(static_cast<btScalar>(epsilon)) {}

  /// A frame begins. Between the tool and a body, which follows a little late, the normal that they
  /// had in the frame before stays while they overlap.
  void begin_frame() {
    std::erase_if(normals_, [](const auto& pair) { return !pair.second.seen; });
    for (auto& [pair, normal] : normals_) normal.seen = false;
  }
  /// The contacts of that object with all others, at the present transforms. It is side a; b.index
  /// is the other's number. Without identities, velocities and loads.
  std::vector<ReportedContact> of(btCollisionObject& object) {
    found_.clear();
    btVector3 low, high, other_low, other_high;
    object.getCollisionShape()->getAabb(object.getWorldTransform(), low, high);
    const btVector3 reach(epsilon_, epsilon_, epsilon_);
    for (int i = 0; i < world_.getNumCollisionObjects(); ++i) {
      btCollisionObject& other = *world_.getCollisionObjectArray()[i];
      if (!may_collide(object, other)) continue;
      other.getCollisionShape()->getAabb(other.getWorldTransform(), other_low, other_high);
      if (!TestAabbAgainstAabb2(low - reach, high + reach, other_low, other_high)) continue;
      ClosestPoints closest(*this, object, other);
      world_.contactPairTest(&object, &other, closest);
    }
    return std::move(found_);
  }

 private:
  /// Numbers of both objects, part and index of the shape of each.
  using PairName = std::tuple<std::uint32_t, int, int, std::uint32_t, int, int>;
  using Part = btCollisionObjectWrapper;

  /// The closest points of two parts.
  struct Closest {
    btVector3 p_B;      ///< Point on b, world, m.
    btVector3 n;        ///< Unit, from b to a.
    btScalar distance;  ///< m.
    const Part& a;
    const Part& b;
  };

  struct ClosestPoints : btCollisionWorld::ContactResultCallback {
    ClosestPoints(NearContacts& contacts, btCollisionObject& a, btCollisionObject& b)
        : contacts_(contacts), a_(a), b_(b) {
      m_closestDistanceThreshold = contacts.epsilon_;
    }
    btScalar addSingleResult(btManifoldPoint& point, const Part* side0, int part0, int index0,
                             const Part* side1, int part1, int index1) override {
      const bool in_order = side0->getCollisionObject() == &a_;
      if (!in_order) {
        std::swap(part0, part1);
        std::swap(index0, index1);
      }
      ReportedContact contact;
      contact.pair = contacts_.pair({number_of(a_), part0, index0, number_of(b_), part1, index1});
      contact.a = side_of(a_);
      contact.b = side_of(b_);
      contact.friction = btManifoldResult::calculateCombinedFriction(&a_, &b_);
      const btVector3& n = point.m_normalWorldOnB;
      const btScalar distance = point.m_distance1;
      contacts_.add(contact, in_order
                                 ? Closest{point.m_positionWorldOnB, n, distance, *side0, *side1}
                                 : Closest{point.m_positionWorldOnA, -n, distance, *side1, *side0});
      return 0;
    }

   private:
    NearContacts& contacts_;
    btCollisionObject& a_;
    btCollisionObject& b_;
  };

  /// The normal of a pair.
  struct Normal {
    btVector3 n_B;     ///< Normal to a, in b's frame.
    bool seen = true;  ///< The pair was seen in this frame.
  };

  /// An axis along which two polyhedra may be apart.
  struct FaceAxis {
    btVector3 n;   ///< Normal of the face, world, to a.
    btScalar gap;  ///< m.
    bool of_a;     ///< It is a's face.
  };

  /// How much larger, m, the gap along a's face must be to be preferred to that of b's, and the gap
  /// along Bullet's normal to that along a face. Less makes pairs that lie on each other change
  /// between the two, more takes the contact of an edge for that of a face.
  static constexpr btScalar kClearlyMore = btScalar(1e-5);

  static bool may_collide(const btCollisionObject& a, const btCollisionObject& b) {
    const btBroadphaseProxy& in_a = *a.getBroadphaseHandle();
    const btBroadphaseProxy& in_b = *b.getBroadphaseHandle();
    return &a != &b && b.hasContactResponse() && a.checkCollideWith(&b) && b.checkCollideWith(&a) &&
           (in_a.m_collisionFilterGroup & in_b.m_collisionFilterMask) != 0 &&
           (in_b.m_collisionFilterGroup & in_a.m_collisionFilterMask) != 0;
  }

  std::uint32_t pair(const PairName& name) {
    return pairs_.try_emplace(name, static_cast<std::uint32_t>(pairs_.size())).first->second;
  }

  void add(const ReportedContact& contact, const Closest& closest) {
    if (of_faces_ && !found_.empty() && found_.back().pair == contact.pair) return;
    const Polyhedron* a = polyhedron(closest.a);
    const Polyhedron* b = polyhedron(closest.b);
    const bool on_plane = closest.b.getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE;
    of_faces_ = a != nullptr && (on_plane ? add_corners(contact, closest, *a)
                                          : b != nullptr && add_faces(contact, closest, *a, *b));
    if (!of_faces_) keep(contact, closest.p_B, closest.n, closest.distance);
  }

  bool add_corners(const ReportedContact& contact, const Closest& closest, const Polyhedron& a) {
    for (const auto& [corner, distance] :
         a.above(closest.p_B, closest.n, closest.a.getWorldTransform())) {
      keep(contact, corner - distance * closest.n, closest.n, distance - a.margin());
    }
    return true;
  }

  /// False if the closest points are those of two edges, or not on the faces.
  bool add_faces(ReportedContact contact, const Closest& closest, const Polyhedron& a,
                 const Polyhedron& b) {
    const btTransform& X_WA = closest.a.getWorldTransform();
    const btTransform& X_WB = closest.b.getWorldTransform();
    const FaceAxis axis = find_axis(contact, a, X_WA, b, X_WB);
    // Between boxes that are aligned and close, Bullet's normal may be far off: its gap is smaller.
    if (gap(a, X_WA, b, X_WB, closest.n) > axis.gap + kClearlyMore && axis.gap > 0) return false;
    const btScalar margins = a.margin() + b.margin();
    const std::size_t before = found_.size();
    if (axis.of_a) {
      contact.plane = PlaneOwner::kA;
      for (const auto& [p, distance] : a.over(X_WA, -axis.n, b, X_WB, epsilon_ + margins)) {
        keep(contact, p + b.margin() * axis.n, axis.n, distance - margins);
      }
    } else {
      for (const auto& [p, distance] : b.over(X_WB, axis.n, a, X_WA, epsilon_ + margins)) {
        keep(contact, p + (b.margin() - distance) * axis.n, axis.n, distance - margins);
      }
    }
    return found_.size() > before;
  }

  /// The face along whose normal the two are farthest apart. Between the tool and a body that
  /// overlap, the one that it was before.
  FaceAxis find_axis(const ReportedContact& contact, const Polyhedron& a, const btTransform& X_WA,
                     const Polyhedron& b, const btTransform& X_WB) {
    const FaceAxis axis = widest(a, X_WA, b, X_WB, nullptr);
    const bool of_tool =
        contact.a.kind == SideKind::kWorld && contact.b.kind == SideKind::kMovableBody;
    if (!of_tool) return axis;
    const btVector3 n_B = X_WB.getBasis().transpose() * axis.n;
    const auto [known, is_new] = normals_.try_emplace(contact.pair, Normal{n_B});
    known->second.seen = true;
    if (axis.gap > 0) known->second.n_B = n_B;
    const btVector3 kept = X_WB.getBasis() * known->second.n_B;
    return is_new || axis.gap > 0 ? axis : widest(a, X_WA, b, X_WB, &kept);
  }

  /// The widest of all faces, or of those whose normal is within 45 degrees of `near`.
  static FaceAxis widest(const Polyhedron& a, const btTransform& X_WA, const Polyhedron& b,
                         const btTransform& X_WB, const btVector3* near) {
    FaceAxis best{{0, 0, 0}, -BT_LARGE_FLOAT, false};
    const auto consider = [&](const btVector3& n, bool of_a) {
      if (near != nullptr && n.dot(*near) < SIMDSQRT12) return;
      const btScalar apart = gap(a, X_WA, b, X_WB, n);
      if (apart > best.gap + (of_a ? kClearlyMore : 0)) best = {n, apart, of_a};
    };
    for (const btVector3& n_B : b.normals()) consider(X_WB.getBasis() * n_B, false);
    for (const btVector3& n_A : a.normals()) consider(X_WA.getBasis() * -n_A, true);
    return best;
  }

  /// How far a is from b along n, m.
  static btScalar gap(const Polyhedron& a, const btTransform& X_WA, const Polyhedron& b,
                      const btTransform& X_WB, const btVector3& n) {
    return -a.reach(X_WA, -n) - b.reach(X_WB, n);
  }

  void keep(ReportedContact contact, const btVector3& p, const btVector3& n, btScalar separation) {
    if (separation > epsilon_) return;
    contact.p_WC = vector_of(p);
    contact.n_W = vector_of(n).normalized();
    contact.separation = separation;
    found_.push_back(contact);
  }

  const Polyhedron* polyhedron(const Part& part) {
    const btCollisionShape* shape = part.getCollisionShape();
    const auto [known, is_new] = polyhedra_.try_emplace(shape);
    if (is_new) known->second = Polyhedron::of(*shape);
    return known->second.get();
  }

  btCollisionWorld& world_;
  btScalar epsilon_;
  std::map<const btCollisionShape*, std::unique_ptr<Polyhedron>> polyhedra_;  ///< Null: none.
  std::map<PairName, std::uint32_t> pairs_;
  std::map<std::uint32_t, Normal> normals_;
  std::vector<ReportedContact> found_;
  bool of_faces_ = false;  ///< The latest pair's were.
};

}  // namespace hlm::bullet
