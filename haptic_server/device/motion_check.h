// Whether what a device says of its handle can be.
#pragma once

#include <cstdint>

#include "hlm/device/device.h"

namespace hlm::server {

/// Finds numbers that are none, mirrors, and a pose that does not follow its speed.
class MotionCheck {
 public:
  /// A handle that moves this fast, m/s, and has one pose as long, s, is frozen: the step of an
  /// encoder is some 10 µm. Longer lets force outlive the motion that it answers, shorter takes a
  /// slow exchange for a frozen one.
  static constexpr double kStaleSpeed = 5e-3;
  static constexpr double kLongestStale = 0.015;

  /// dt: between two calls of find_error(), s.
  explicit MotionCheck(double dt) noexcept : dt_(dt) {}

  void begin() noexcept { stale_ = 0; }
  /// What is wrong with the latest pose and twist, in words; null if nothing. R: the rotation as
  /// the device gives it. is_old: whether it says itself that they are not new.
  const char* find_error(const Vector3& p, const Matrix3& R, const Twist& V, bool is_old) noexcept;

 private:
  double dt_;
  std::uint64_t stale_ = 0;  ///< Ticks without a new pose although there should be one.
  Vector3 p_before_ = Vector3::Zero();
};

}  // namespace hlm::server
