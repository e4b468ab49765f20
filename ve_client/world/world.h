// The simulated world: rigid bodies, joints and contacts, stepped by the Open Dynamics Engine.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <ode/ode.h>

#include "hlm/common/spatial.h"
#include "hlm/geometry/convex.h"
#include "hlm/geometry/internal_edges.h"
#include "hlm/geometry/manifold.h"
#include "hlm/geometry/pieces.h"
#include "hlm/ve_client/scene/world_description.h"
#include "hlm/ve_client/world/broad_phase.h"
#include "hlm/ve_client/world/carried_contact.h"
#include "hlm/ve_client/world/contact_memory.h"
#include "hlm/ve_client/world/joints.h"
#include "hlm/ve_client/world/mobility.h"
#include "hlm/ve_client/world/rest.h"

namespace hlm::ve {

/// Bodies are named by their index in the description. Repeatable: two worlds that are given the
/// same calls have the same states bit for bit. One thread makes and uses a world; others may have
/// worlds of their own.
class World {
 public:
  /// Called before each step of the solver with its length, s: what it adds by add_wrench() acts
  /// during that step only.
  using Drive = std::function<void(double h)>;

  /// Bodies in `tool_bodies` are those of the virtual tools: they have no weight here (the proxies
  /// carry it), touch others only through the contacts given to step(), and never each other.
  /// Throws std::runtime_error with one line where a joint's spring or damping is too large for the
  /// solver's steps.
  World(const WorldDescription& description, std::span<const int> tool_bodies);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  const WorldDescription& description() const noexcept { return description_; }
  bool is_tool(int body) const { return is_tool_[at(body)]; }
  /// Whether a body can be pushed: it is neither fixed nor a tool's.
  bool is_movable(int body) const { return bodies_[at(body)] != nullptr && !is_tool_[at(body)]; }
  /// Whether a movable body is at rest (see Rest), until something awake or the tool touches it, or
  /// it is pushed, sent or placed from outside.
  bool rests(int body) const { return is_movable(body) && !rest_->is_awake(body); }

  /// A number that changes whenever a pose of a body that is not a tool's may have.
  unsigned long changes() const noexcept { return changes_; }
  /// Pose of a body's frame B (at its centre of mass).
  Pose X_WB(int body) const;
  /// Velocity of B's origin and angular velocity, world axes.
  Twist V_WB(int body) const;
  /// Velocity of the point of a body that is now at p_W, m/s, world.
  Vector3 velocity_at(int body, const Vector3& p_W) const;
  const Joints& joints() const noexcept { return *joints_; }
  const CollisionDescription& collision(const CollisionId& id) const {
    return description_.bodies[at(id.body)].collisions[at(id.shape)];
  }
  const Convex& convex(const CollisionId& id) const { return shapes_[at(id.body)][at(id.shape)]; }
  const Pieces& pieces() const noexcept { return *pieces_; }
  /// Pose of a collision shape's frame.
  Pose X_WG(const CollisionId& id) const { return X_WB(id.body) * collision(id).X_BG; }

  // For bodies that are not fixed.
  /// Sets the pose of a movable body: wakes all, for any may have rested on it.
  void set_pose(int body, const Pose& X_WB);
  void set_velocity(int body, const Twist& V_WB);
  /// Somebody else moves a movable body until let_go(): it is there, and goes on at V_WB whatever
  /// it meets.
  void hold(int body, const Pose& X_WB, const Twist& V_WB);
  void let_go(int body);
  bool is_held(int body) const;
  /// Applies a wrench about B's origin, world axes, during the next step.
  void add_wrench(int body, const Wrench& F);
  /// Makes a movable body resist acceleration `factor` (>= 1) times as much as the
  /// description says; its weight stays. A body that resists more is slowed down to the momentum
  /// that it had.
  void set_inertia_factor(int body, double factor);
  /// 1 unless set.
  double inertia_factor(int body) const {
    const auto found = inertia_factors_.find(body);
    return found == inertia_factors_.end() ? 1 : found->second;
  }
  /// Makes the body move as set_velocity() says, whatever it meets. Its joints are removed.
  void make_kinematic(int body);
  /// Keeps the body in the plane z = const, and from tilting out of it, from here on.
  void keep_planar(int body);

  /// How many steps of the solver a step of dt seconds is: as many as the description's largest
  /// step needs; where it gives none, 960 a second, or one where nothing but the tool can move.
  int substeps(double dt) const noexcept;
  /// The longest step of the solver, s.
  double longest_step() const noexcept;
  /// Advances by dt (s, > 0). `tool_contacts` are those of the present poses, and stay with the
  /// surfaces of their bodies meanwhile. They let the tool approach by no more than σ: it comes to
  /// rest on a wall, however fast it came, instead of inside.
  void step(double dt, std::span<const ToolContact> tool_contacts, const Drive& drive = {});
  /// The mobility of a body that is not fixed.
  Mobility mobility_of(int body) const;
  /// Why the world stands still for good: a body went where no body goes. Empty as long as it
  /// moves.
  const std::optional<std::string>& fault() const noexcept { return fault_; }

  /// What the contacts among bodies that are not a tool's carried in the latest step().
  const ContactMemory& loads() const noexcept { return memory_; }
  /// Whether the engine lets two bodies touch: not those that a joint connects.
  bool can_touch(int first, int second) const;

 private:
  template <class T, void (*destroy)(T*)>
  struct Destroy {
    void operator()(T* handle) const { destroy(handle); }
  };
  template <class T, void (*destroy)(T*)>
  using Handle = std::unique_ptr<T, Destroy<T, destroy>>;

  static std::size_t at(int index) { return static_cast<std::size_t>(index); }
  dBodyID handle(int body) const { return bodies_[at(body)]; }
  void add_bodies();
  void place(int body, const Pose& X_WB);
  void set_mass(int body);
  void require_slow_springs() const;
  /// The acceleration along a joint's axis for each unit of force or torque there, 1/kg or
  /// 1/(kg·m²).
  double joint_mobility(int joint) const;
  void push_held();
  void solve(double h);
  void find_fault();
  void wake(int body);
  /// A movable body is pushed, sent or touched from outside.
  void disturb(int body);
  /// Bodies that have been still for a while come to rest, after a frame.
  void settle(double dt);
  /// Leaves a body that has come to rest out of the engine's steps.
  void stop(int body);
  /// Contacts of all bodies that are awake, and of those that they wake.
  void collide_all();
  bool touch(const CollisionId& first, const CollisionId& second);
  /// Contacts of two shapes that are not a tool's.
  void collide(CollisionId first, CollisionId second);
  void add_contact(const FoundContact& found);
  void bound_friction(dContact& contact, const FoundContact& found) const;
  void add_contact(const ToolContact& tool_contact);

  WorldDescription description_;
  std::vector<bool> is_tool_;
  std::vector<int> tool_bodies_;
  bool has_movable_ = false;
  std::vector<std::vector<Convex>> shapes_;  ///< [body][shape].
  std::optional<Pieces> pieces_;
  Handle<dxWorld, dWorldDestroy> world_;
  Handle<dxJointGroup, dJointGroupDestroy> contacts_;
  std::vector<dBodyID> bodies_;  ///< Null for fixed bodies.
  std::vector<double> radii_;    ///< Radii of spheres about B's origins around all shapes, m.
  std::optional<BroadPhase> broad_phase_;
  std::optional<Rest> rest_;
  std::vector<int> woken_;  ///< Bodies woken by the body whose contacts are being found.
  std::optional<Joints> joints_;
  std::map<int, Wrench> held_;             ///< Wrenches on bodies during the next step().
  std::map<int, double> inertia_factors_;  ///< Factors of the bodies that have one other than 1.
  bool stepping_ = false;
  double substep_ = 0;  ///< Length of the present one, s.
  ContactMemory memory_;
  std::vector<FoundContact> touching_;  ///< Contacts of the present pair.
  ProximityStatistics statistics_;
  unsigned long steps_ = 0;
  unsigned long changes_ = 0;
  std::optional<std::string> fault_;
};

}  // namespace hlm::ve
