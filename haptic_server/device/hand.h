// The hand on a simulated device: a sequence of pushes and reaches.
#pragma once

#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::server {

/// The hand pushes wherever the handle is: F(t) = constant + amplitude sin(2π frequency t + phase),
/// t from the segment's start; world axes, about the handle's origin.
struct Push {
  Wrench constant = Wrench::Zero();
  Wrench amplitude = Wrench::Zero();
  double frequency = 0;  ///< Hz, >= 0.
  double phase = 0;      ///< rad.
};

/// How firmly a reaching hand holds the handle: a spring and a damper to where it wants to be.
struct Grip {
  double stiffness = 200;        ///< N/m, >= 0.
  double damping = 20;           ///< N·s/m, >= 0.
  double angular_stiffness = 1;  ///< N·m/rad, >= 0.
  double angular_damping = 0.1;  ///< N·m·s/rad, >= 0.
  double max_force = 10;         ///< N, >= 0. The hand does not pull harder.
  double max_torque = 0.5;       ///< N·m, >= 0.
};

/// Wrench of a grip on the handle: e and e_dot are displacement and twist of the target less those
/// of the handle, world axes.
Wrench grip_wrench(const Grip& grip, const Vector6& e, const Twist& e_dot) noexcept;

/// The hand moves its target from where it was (the target of a reach before, otherwise the
/// handle's pose) with minimum jerk and draws the handle along.
struct Reach {
  std::optional<Vector3> position;  ///< Target, m; empty: stays where it was.
  std::optional<Vector3> rotation;  ///< Target, rotation vector, rad; empty: stays.
  /// Target is a displacement from the handle's pose at the hand's start, world axes; otherwise it
  /// is a pose in the world.
  bool relative = false;
  Grip grip;
};

struct HandSegment {
  double duration = 1;  ///< s, > 0.
  std::variant<Push, Reach> action;
  /// Where its fingers bring the device's gripper, 0 closed to 1 open; empty: it stays.
  std::optional<double> opening = {};
};

enum class AfterLastSegment {
  kRelease,  ///< The hand lets go: no wrench.
  kHold,     ///< The last segment goes on; a reach stays at its target.
  kRepeat,   ///< The first segment follows.
};

struct HandScript {
  std::vector<HandSegment> segments;  ///< None: no hand at all.
  AfterLastSegment after = AfterLastSegment::kRelease;
};

/// Plays a script. Only the constructor allocates.
class Hand {
 public:
  explicit Hand(HandScript script);

  /// Time zero, with the handle at X_WD.
  void start(const Pose& X_WD) noexcept;
  /// Goes on to time t (s, never back), when the handle is at X_WD.
  void advance(double t, const Pose& X_WD) noexcept;
  /// Wrench of the hand on the handle at X_WD with twist V_WD, world axes, about its origin, at a
  /// time t (s) not before the latest advance().
  Wrench wrench(double t, const Pose& X_WD, const Twist& V_WD) const noexcept;
  /// Of the gripper at a time t as above; empty: the script has none.
  std::optional<double> opening(double t) const noexcept;

 private:
  void enter(std::size_t segment, const Pose& X_WD) noexcept;
  bool released() const noexcept { return segment_ == script_.segments.size(); }

  HandScript script_;
  std::size_t segment_ = 0;   ///< Present one; one past the last when the hand has let go.
  double segment_begin_ = 0;  ///< s.
  Pose X_WStart_;             ///< Handle at time zero.
  Pose X_WFrom_;              ///< Target at the start of the present segment, if it is a reach.
  Pose X_WTo_;                ///< Target at its end.
  /// Of the gripper at the start of the present segment, and at its end.
  std::optional<double> opening_from_;
  std::optional<double> opening_to_;
};

}  // namespace hlm::server
