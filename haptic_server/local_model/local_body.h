// A movable body near the tool, as the local model moves it between updates (docs/method.md 11).
#pragma once

#include <optional>

#include "hlm/common/contact.h"
#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/scene/mechanism.h"

namespace hlm::server {

/// The twist at a point that lies `arm` (m) away from the one of V.
inline Twist shifted(const Twist& V, const Vector3& arm) noexcept {
  Twist moved = V;
  moved.head<3>() += V.tail<3>().cross(arm);
  return moved;
}

/// How long after its report the acceleration of a body is taken to change as it did, s. Longer,
/// what turns comes back, and is farther off than with the acceleration as it was.
inline constexpr double kLongestTrend = 0.2;

/// Twists and wrenches about the centre of mass, world axes.
struct LocalBody {
  LocalBody() = default;
  /// A body in the state that was reported.
  explicit LocalBody(const MovableBody& reported) noexcept;
  /// One that the server moves itself from there on.
  LocalBody(const BodyInertia& inertia, const BodyPose& pose) noexcept;

  /// What the server knows of one that it moves itself. Such a body has no impulses.
  std::optional<BodyInertia> inertia;
  bool stands_still = false;             ///< hold() has been called.
  Matrix3 R_CP = Matrix3::Identity();    ///< Principal axes of its inertia,
  Vector3 mobility_P = Vector3::Zero();  ///< and 1/√ of its moments about them.
  double pace = 1;         ///< Of its time in the hand's, in which it has 1/pace² of its mass,
  double wanted_pace = 1;  ///< and what that comes to.
  /// Place of its mechanism among those of the local model, and in that; -1: no joint holds it.
  int mechanism = -1;
  std::size_t member = 0;
  /// The step of dt, s, begins: pace, and from its inertia B and A_W where it is now. Of others
  /// they are reported, or its mechanism's.
  void begin_step(double dt) noexcept;

  std::uint32_t id = 0;
  std::size_t slot = 0;  ///< Slot of the body's impulses.
  /// Origin at the centre of mass; the world's axes in the reported state. It turns as the shape
  /// does: not about the axis of a surface of revolution, and a sphere's never.
  Pose X_WB;
  Roundness roundness = Roundness::kNone;
  Vector3 axis_B = Vector3::Zero();  ///< Axis of revolution, unit.
  Twist V_W = Twist::Zero();
  /// 6×n: W = B Bᵀ, so that an impulse P changes the velocity by B (Bᵀ P): in these coordinates the
  /// body has unit mass, and moves only as its joints allow.
  Jacobian B;
  Vector6 A_W = Vector6::Zero();  ///< Acceleration by all forces except contacts, m/s², rad/s²,
  Vector6 A_rate_W = Vector6::Zero();    ///< and how fast it changes, 1/s,
  double A_changes_for = kLongestTrend;  ///< still so long, s.
  /// Impulse of the tool that the environment had yet to apply in the step that the update is
  /// about.
  Vector6 pending_W = Vector6::Zero();

  /// What an update found V_W to be wrong by; it enters over the steps of one frame.
  Twist correction = Twist::Zero();
  int correction_steps = 0;  ///< Left.

  /// What the body's motion has shown its friction on what does not move with the tool to be, as a
  /// share of what is reported.
  double friction_scale = 1;

  /// V at the end of a step of dt (s) without contacts.
  Twist free_twist(double dt) const noexcept;
  /// The part of its angular velocity that turns its shape, rad/s.
  Vector3 turning_W() const noexcept;
  /// Goes on for dt with V at the end of the step; held where it is if it is not plausible then.
  void advance(const Twist& V, double dt) noexcept;
  /// Whether it is somewhere, and no faster than anything that a hand touches.
  bool is_plausible() const noexcept;
  /// Makes it a body at X_WHeld that nothing moves, until it is reported again.
  void hold(const Pose& X_WHeld) noexcept;
};

/// Bodies of one mechanism follow each other.
using LocalBodies = StaticVector<LocalBody, kMaxMovedBodies>;
using Mechanisms = StaticVector<Mechanism, kMaxMovedBodies>;

/// The step of dt, s, begins, of all bodies.
void begin_step(LocalBodies& bodies, Mechanisms& mechanisms, double dt) noexcept;
/// Body and mechanism are the same again: where the body is, and how it moves.
void move_with(LocalBody& body, const Mechanism& mechanism) noexcept;

}  // namespace hlm::server
