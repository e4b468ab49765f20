#include "haptic_server/control/limiter.h"

#include <algorithm>

namespace hlm::server {

namespace {

/// v, shortened to `length` if it is longer.
Vector3 shortened(const Vector3& v, double length) noexcept {
  const double norm = v.norm();
  return norm > length ? Vector3(v * (length / norm)) : v;
}

}  // namespace

Limiter::Limiter(const ForceBudget& budget, double fade_time, double dt) noexcept
    : budget_(budget), fade_step_(fade_time > dt ? dt / fade_time : 1) {}

void Limiter::cut() noexcept {
  wanted_ = false;
  portion_ = 0;
  previous_.setZero();
}

Wrench Limiter::limit(const Wrench& F) noexcept {
  portion_ = std::clamp(portion_ + (wanted_ ? fade_step_ : -fade_step_), 0.0, 1.0);
  met_non_finite_ = !F.allFinite();
  limited_by_ = ForceLimit::kNone;
  if (met_non_finite_) {
    previous_.setZero();
    return previous_;
  }
  const Vector3 most_force = shortened(F.head<3>(), budget_.max_force);
  const Vector3 most_torque = shortened(F.tail<3>(), budget_.max_torque);
  if (most_force != F.head<3>()) limited_by_ = ForceLimit::kForce;
  // That a device takes no torque is no limit that is met.
  const bool less_torque = budget_.max_torque > 0 && most_torque != F.tail<3>();
  if (less_torque) limited_by_ = ForceLimit::kTorque;
  if (portion_ < 1) limited_by_ = ForceLimit::kFade;
  const Vector3 force = portion_ * most_force;
  const Vector3 torque = portion_ * most_torque;
  previous_.head<3>() += shortened(force - previous_.head<3>(), budget_.max_force_step);
  previous_.tail<3>() += shortened(torque - previous_.tail<3>(), budget_.max_torque_step);
  const bool reached = previous_.head<3>().isApprox(force) && previous_.tail<3>().isApprox(torque);
  if (limited_by_ == ForceLimit::kNone && !reached) limited_by_ = ForceLimit::kRate;
  return previous_;
}

}  // namespace hlm::server
