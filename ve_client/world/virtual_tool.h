// The virtual tool in the world: it follows the proxy, and says where it really is.
#pragma once

#include "hlm/common/tool_model.h"
#include "hlm/common/vocabulary.h"
#include "hlm/ve_client/scene/tool_assembly.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// How the tool follows the proxy.
enum class FollowMode {
  kImplicit,   ///< Drawn by springs and dampers: walls stop it, loose bodies are pushed aside.
  kKinematic,  ///< Carried to the proxy's configuration in every step, through everything.
};

}  // namespace hlm::ve

namespace hlm {

template <>
inline constexpr std::array<Word<ve::FollowMode>, 2> kWords<ve::FollowMode>{{
    {ve::FollowMode::kImplicit, "implicit", "drawn by springs and dampers"},
    {ve::FollowMode::kKinematic, "kinematic", "carried there through everything"},
}};

}  // namespace hlm

namespace hlm::ve {

struct FollowOptions {
  FollowMode mode = FollowMode::kImplicit;
  /// Undamped natural frequency of the tool on its springs, Hz, > 0. At 60 Hz the tool is within a
  /// few per cent of a still proxy after 3 frames; lower lags, higher presses harder on walls.
  double frequency = 60;
  double damping_ratio = 1;  ///< >= 0; below 1 the tool overshoots.
  /// Largest force on one link, N, > 0; its torque is bounded by this times the tool's length.
  double max_force = 50;
};

/// Owns the tool's part of a World. Not thread-safe.
class VirtualTool {
 public:
  /// `world` was built with `assembly.bodies` as the tool and outlives this.
  VirtualTool(World& world, const ToolAssembly& assembly, const FollowOptions& options);

  const ToolAssembly& assembly() const noexcept { return assembly_; }

  /// Whether a configuration and velocity from outside can be followed: right sizes, a usable
  /// quaternion, and nothing farther than 1 km or faster than 1 km/s (values that would overflow in
  /// the engine).
  bool can_follow(const Configuration& q, const Velocity& v) const noexcept;
  /// Sets what follow() follows: the proxy's configuration, and its velocity during the next step
  /// (after it the target is at rest until the next target). Requires can_follow(q, v).
  void set_target(const Configuration& q, const Velocity& v);
  /// Upper bound on the speed of any point of the latest target, m/s.
  double target_speed() const noexcept { return target_speed_; }

  /// The world's time goes by `pace` (> 0) seconds in one of the hand's, in which targets and v()
  /// are. 1 at first.
  void set_pace(double pace);
  /// Carries the tool to its target through everything, in a world that stands still.
  void carry();

  /// Begins a step of dt seconds. Returns how far the tool's points will move in it at most if
  /// nothing stops them, m.
  double follow(double dt);
  /// Applies to the bodies what draws them toward the target during one step of the world's solver,
  /// h seconds: on each, M a with
  /// a = (ω²(x_T − x − h v) + 2ζω(v_T − v)) / (1 + 2ζω h + ω² h²), which is a spring and damper
  /// integrated by the backward Euler rule: stable for any ω h.
  void pull(double h);
  /// Reads q and q̇ from the bodies after a step, and removes what they drifted off their joints:
  /// from here on they are exactly in that configuration.
  void read_back();

  /// Puts the tool and its bodies at q, with the velocity that it has.
  void place(const Configuration& q);
  /// Upper bound on how far any point of the tool is from where it is drawn to, m.
  double lag() const;
  /// A configuration on the straight way from `q` to the target: `share` 0 at q, 1 there. Joints
  /// without limits take the shorter turn.
  Configuration on_the_way(const Configuration& q, double share) const;

  /// Configuration q_VE in which the tool is, after the latest read_back(). Angles are continuous.
  const Configuration& q() const noexcept { return model_.configuration(); }
  Velocity v() const { return pace_ * v_; }
  /// Pose of the body of a link in the world.
  Pose X_WB(int link) const { return model_.X_WL(link) * assembly_.X_LB[at(link)]; }
  /// And where that is drawn to.
  Pose X_WB_target(int link) const { return target_.X_WL(link) * assembly_.X_LB[at(link)]; }

 private:
  static std::size_t at(int index) { return static_cast<std::size_t>(index); }
  /// Upper bound on the speed of a link's points, from the twist of its centre of mass, m/s.
  double point_speed(const Twist& V_WB) const noexcept;
  /// Acceleration by pull() on a link's body at velocity V_WB and with displacement e to its
  /// target.
  Vector6 acceleration(int link, const Vector6& e, const Twist& V_WB, double h) const;
  /// How far the points of a link move if it is drawn for dt and nothing stops it, m.
  double free_travel(int link, double dt) const;
  /// Inertia of a body about its centre of mass, world axes, kg·m².
  Matrix3 inertia(int body) const;
  void read_joint(int link, int coordinate, int velocity, Configuration& q);

  World& world_;
  ToolAssembly assembly_;
  FollowOptions options_;
  double pace_ = 1;
  ToolModel model_;    ///< Model at q_VE.
  Velocity v_;         ///< In the world's time, as the velocities of bodies are.
  ToolModel target_;   ///< Model at the proxy's configuration.
  Velocity v_target_;  ///< In the hand's time, as the next; zero after its step.
  Velocity v_proxy_;   ///< Velocity of the latest target.
  double target_speed_ = 0;
};

}  // namespace hlm::ve
