// Whether what a device says of its handle can be.
#pragma once

#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// Finds numbers that are none, mirrors, and a pose and a speed that do not belong together. A
/// device does not measure its speed but estimates it from its encoders' steps: as the mean over a
/// window (Force Dimension: 20 ms unless told otherwise) or through a low-pass (OpenHaptics: some
/// 20 Hz). So for a while after a stop it still reports a speed, and after a start too little.
/// A speed that the driver itself makes of the poses tells nothing that they do not: then a pose
/// that stays is frozen where no hand stops a handle so soon.
class MotionCheck {
 public:
  /// Who makes the speed of poses.
  enum class SpeedSource { kDevice, kDriver };

  /// A handle that reports more than this, m/s, moves: two steps of a coarse encoder in 20 ms.
  static constexpr double kStaleSpeed = 5e-3;
  /// One pose and one speed above kStaleSpeed for as long, s, are frozen: an estimate changes.
  /// Longer lets force outlive the motion that it answers, shorter takes a slow exchange for a
  /// frozen one.
  static constexpr double kLongestStale = 0.015;
  /// One pose and any speed above kStaleSpeed for as long, s, are frozen: from 2 m/s an estimate at
  /// 20 Hz needs 50 ms. Longer sees less, shorter takes a stop for a fault.
  static constexpr double kLongestStop = 0.1;
  /// How far an estimate of the speed may lag behind the pose, s: a mean over 20 ms by 10 ms.
  static constexpr double kLongestLag = 0.02;
  /// How far a pose may be from where its speed leads, m, besides that lag: a mean over 20 ms does
  /// not see a handle that buzzes at 50 Hz. More lets a jump through, less makes a buzz a fault.
  static constexpr double kFarthestJump = 3e-3;
  /// Memory of that distance, s. More than kLongestLag, so that a wrong speed shows.
  static constexpr double kMemory = 0.05;
  /// No hand is faster, m/s.
  static constexpr double kFastest = 10;
  /// A handle that is so fast over kBraking, m/s and s, does not stand for kLongestStale right
  /// after: a hand would brake it with 75 m/s², the 2DIY's motors do with 8 m/s². Less takes a
  /// hard stop for a fault, more does not see a slow handle freeze.
  static constexpr double kHardestStop = 0.15;
  static constexpr double kBraking = 2e-3;
  /// An orientation that is farther from the one before, rad, jumps, besides what a hand turns in
  /// that time, rad/s. More lets a jump through, less takes a grip that misses states for one.
  static constexpr double kFarthestTurn = 0.5;
  static constexpr double kFastestTurn = 30;
  /// One orientation and one angular speed above kStaleTurn, rad/s, for as long, s, are frozen: a
  /// mean over 20 ms is the same for as long after a single step.
  static constexpr double kStaleTurn = 0.05;
  static constexpr double kLongestStaleTurn = 0.025;

  /// window: the device's speed is a mean over that time, s; 0: over none that is known.
  void begin(double window = 0, SpeedSource source = SpeedSource::kDevice) noexcept;
  /// What is wrong with the pose and the twist at `now`, s, in words; null if nothing. now: of any
  /// clock that does not go back. R: the rotation as the device gives it. is_old: whether it says
  /// itself that they are not new. age: how much older than `now` they may be, s.
  const char* find_error(double now, const Vector3& p, const Matrix3& R, const Twist& V,
                         bool is_old, double age = 0) noexcept;

 private:
  const char* find_stale(double seen) const noexcept;
  void observe_change(double now, const Vector3& p, const Matrix3& R, const Twist& V,
                      double age) noexcept;
  void observe_step(double now, const Vector3& way, double age) noexcept;
  const char* find_jump(double now, const Vector3& p, const Matrix3& R, const Vector3& v,
                        double age) noexcept;

  double longest_stale_ = kLongestStale;
  SpeedSource source_ = SpeedSource::kDevice;
  bool has_begun_ = false;
  double now_ = 0;                         ///< Time of the latest pose, s,
  double age_ = 0;                         ///< and how much older it may be.
  double fresh_at_ = 0;                    ///< When values were last new, s.
  double changed_at_ = 0;                  ///< When pose or speed last changed, or it rested, s.
  double moved_at_ = 0;                    ///< When the pose last changed, or it rested, s.
  double stepped_at_ = 0;                  ///< When the position last changed, s,
  Vector3 step_speed_ = Vector3::Zero();   ///< and how fast it was over kBraking then, m/s.
  double turned_at_ = 0;                   ///< When orientation or its speed last did, s.
  Vector3 p_ = Vector3::Zero();            ///< Latest pose,
  Matrix3 R_ = Matrix3::Identity();        ///< orientation,
  Twist V_ = Twist::Zero();                ///< and twist.
  Vector3 unexplained_ = Vector3::Zero();  ///< Way that its speed did not lead, m.
  double speed_ = 0;                       ///< Largest of late, m/s.
};

}  // namespace hlm::server
