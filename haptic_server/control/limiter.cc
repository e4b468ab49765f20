#include "haptic_server/control/limiter.h"

#include <algorithm>

namespace hlm::server {

using protocol::ForceLimit;

namespace {

/// v, shortened to `length` if it is longer.
Vector3 shortened(const Vector3& v, double length) noexcept {
  const double norm = v.norm();
  return norm > length ? Vector3(v * (length / norm)) : v;
}

}  // namespace

Limiter::Limiter(const LimiterOptions& options, const DeviceRatings& device, double dt) noexcept
    : max_force_(std::min(options.max_force, device.max_force)),
      max_torque_(std::min(options.max_torque, device.max_torque)),
      max_force_step_(device.max_force_rate * dt),
      max_torque_step_(device.max_torque_rate * dt),
      fade_step_(options.fade_time > dt ? dt / options.fade_time : 1) {}

void Limiter::cut() noexcept {
  wanted_ = false;
  portion_ = 0;
  previous_.setZero();
}

Wrench Limiter::limit(const Wrench& F) noexcept {
  portion_ = std::clamp(portion_ + (wanted_ ? fade_step_ : -fade_step_), 0.0, 1.0);
  met_non_finite_ = !F.allFinite();
  limited_by_ = portion_ < 1 ? ForceLimit::kFade : ForceLimit::kNone;
  if (met_non_finite_ || portion_ == 0) {
    previous_.setZero();
    return previous_;
  }
  const Vector3 force = shortened(portion_ * F.head<3>(), max_force_);
  const Vector3 torque = shortened(portion_ * F.tail<3>(), max_torque_);
  if (force != portion_ * F.head<3>()) limited_by_ = ForceLimit::kForce;
  if (torque != portion_ * F.tail<3>()) limited_by_ = ForceLimit::kTorque;
  previous_.head<3>() += shortened(force - previous_.head<3>(), max_force_step_);
  previous_.tail<3>() += shortened(torque - previous_.tail<3>(), max_torque_step_);
  const bool reached = previous_.head<3>().isApprox(force) && previous_.tail<3>().isApprox(torque);
  if (limited_by_ == ForceLimit::kNone && !reached) limited_by_ = ForceLimit::kRate;
  return previous_;
}

}  // namespace hlm::server
