// The simulated world: rigid bodies, joints and contacts, stepped by the Open Dynamics Engine.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <ode/ode.h>

#include "common/spatial.h"
#include "ve_client/world/world_description.h"

namespace hlm::ve {

/// A contact of the tool, present or within reach of the next step.
struct ToolContact {
  int tool_body = 0;
  int body = 0;
  Vector3 p_W = Vector3::Zero();   ///< m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit, from `body` to the tool.
  double separation = 0;           ///< σ, m.
  double friction = 0;             ///< μ.
};

/// One collision shape of the world.
struct CollisionId {
  int body = 0;
  int shape = 0;

  auto operator<=>(const CollisionId&) const = default;
};

/// Bodies are named by their index in the description. Repeatable: two worlds that are given the
/// same calls have the same states bit for bit. One thread makes and uses a world; others may have
/// worlds of their own.
class World {
 public:
  /// Bodies in `tool_bodies` are the virtual tool: they have no weight here (the proxy carries it)
  /// and touch others only through the contacts given to step().
  World(const WorldDescription& description, std::span<const int> tool_bodies);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  const WorldDescription& description() const noexcept { return description_; }

  /// Pose of a body's frame B (at its centre of mass).
  Pose X_WB(int body) const;
  /// Velocity of B's origin and angular velocity, world axes.
  Twist V_WB(int body) const;
  /// Velocity of the point of a body that is now at p_W, m/s, world.
  Vector3 velocity_at(int body, const Vector3& p_W) const;

  // For bodies that are not fixed.
  void set_pose(int body, const Pose& X_WB);
  void set_velocity(int body, const Twist& V_WB);
  /// Applies a wrench about B's origin, world axes, during the next step.
  void add_wrench(int body, const Wrench& F);
  /// From here on the body moves as set_velocity() says, whatever it meets. Its joints are removed.
  void make_kinematic(int body);
  /// From here on the body neither leaves the plane z = const nor tilts out of it.
  void keep_planar(int body);

  /// Advances by dt (s, > 0). `tool_contacts` hold in the present poses. They let the tool approach
  /// by no more than σ: it comes to rest on a wall, however fast it came, instead of inside.
  void step(double dt, std::span<const ToolContact> tool_contacts);

  /// Shapes of other bodies than the tool's whose bounding boxes meet `box` (world, m), in order.
  void find_near(const Eigen::AlignedBox3d& box, std::vector<CollisionId>& found);

 private:
  template <class T, void (*destroy)(T*)>
  struct Destroy {
    void operator()(T* handle) const { destroy(handle); }
  };
  template <class T, void (*destroy)(T*)>
  using Handle = std::unique_ptr<T, Destroy<T, destroy>>;

  void add_bodies(std::span<const int> tool_bodies);
  void add_geometries(int body);
  void add_joint(const JointDescription& joint);
  void add_contact(dContact& contact, dBodyID first, dBodyID second);
  void solve(double dt);
  /// Contacts of two shapes that are not the tool's.
  void collide(dGeomID first, dGeomID second);
  dBodyID handle(int body) const { return bodies_[static_cast<std::size_t>(body)]; }

  WorldDescription description_;
  Handle<dxWorld, dWorldDestroy> world_;
  Handle<dxSpace, dSpaceDestroy> space_;
  Handle<dxJointGroup, dJointGroupDestroy> contacts_;
  Handle<dxGeom, dGeomDestroy> query_box_;  ///< In no space.
  std::vector<dBodyID> bodies_;             ///< Null for fixed bodies.
  std::vector<CollisionId> collision_ids_;  ///< Each geometry points to its own.
  unsigned long steps_ = 0;
};

}  // namespace hlm::ve
