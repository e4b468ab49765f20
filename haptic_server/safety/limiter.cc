#include "hlm/haptic_server/safety/limiter.h"

#include <algorithm>

namespace hlm::server {

namespace {

/// v, shortened to `length` if it is longer.
Vector3 shortened(const Vector3& v, double length) noexcept {
  const double norm = v.norm();
  return norm > length ? Vector3(v * (length / norm)) : v;
}

/// The share of a whole that each step takes.
double step_of(double time, double dt) noexcept { return time > dt ? dt / time : 1; }

/// The portion of a change that a step allows.
double portion_of(const Vector3& change, double step) noexcept {
  const double norm = change.norm();
  return norm > step ? step / norm : 1;
}

/// The value between from and to by that portion.
template <class Part>
Vector3 between(const Part& from, const Vector3& to, double portion) noexcept {
  return portion < 1 ? Vector3(from + portion * (to - from)) : to;
}

/// The most damping that takes back energy given too much, N·s/m and N·m·s/rad: what a light
/// device of 0.06 kg still takes at 1 kHz. More gets it back sooner, and makes such a device buzz.
constexpr double kLargestDamping = 30;
constexpr double kLargestAngularDamping = 0.03;

/// f without so much of its part along v that it gives more than `most`, W; if that is negative it
/// takes as much, by a damper of at most `damping`.
Vector3 power_limited(const Vector3& f, const Vector3& v, double most, double damping) noexcept {
  const double speed = v.norm();
  if (speed == 0 || f.dot(v) <= most) return f;
  const double along = most >= 0 ? most / speed : -std::min(-most / speed, damping * speed);
  const double present = f.dot(v) / speed;
  return present <= along ? f : Vector3(f - (present - along) / speed * v);
}

/// What is left of `part`, a part of F, in `rendered`, F shortened.
Vector3 share_of(const Vector3& part, const Vector3& F, const Vector3& rendered) noexcept {
  const double size = F.norm();
  return size > 0 ? Vector3(part * (rendered.norm() / size)) : part;
}

}  // namespace

Limiter::Limiter(const LimiterOptions& allowed, const DeviceRatings& device, double dt) noexcept
    : budget_(ForceBudget::of(allowed, device, dt)),
      dt_(dt),
      scale_(device.scale),
      torque_scale_(device.torque_scale()),
      fade_step_(step_of(allowed.fade_time, dt)),
      rise_step_(step_of(allowed.rise_time, dt)),
      spreader_(budget_, dt),
      warmth_(device.max_force, device.continuous_force, ForceBudget::kWarmingTime),
      tank_(budget_.energy, device.scale) {}

void Limiter::cut() noexcept {
  wanted_ = false;
  portion_ = 0;
  spreader_.clear();
  steady_.setZero();
  command_.setZero();
  weight_.setZero();
}

void Limiter::restart() noexcept {
  wanted_ = false;
  portion_ = 0;
  spreader_.forget();
  tank_.begin();
}

Wrench Limiter::limit_power(const Wrench& F, const Twist& V) noexcept {
  const double allowed = tank_.allowed_power();
  const auto limited = [allowed](const Vector3& f, const Vector3& v, double most, double damping,
                                 double size) {
    const Vector3 less = power_limited(f, v, std::min(most, allowed), damping);
    return less == f ? f : shortened(less, size);
  };
  // V / scale_ gives the power at the handle. The damping, too, is that of the handle.
  const double angular_damping = kLargestAngularDamping * torque_scale_ * torque_scale_;
  Wrench less;
  less << limited(F.head<3>(), V.head<3>() / scale_, budget_.max_power, portion_ * kLargestDamping,
                  budget_.max_force),
      limited(F.tail<3>(), V.tail<3>() / scale_, budget_.max_turning_power,
              portion_ * angular_damping, budget_.max_torque);
  if (less != F && limited_by_ != ForceLimit::kFade) {
    limited_by_ = allowed < budget_.max_power ? ForceLimit::kEnergy : ForceLimit::kPower;
  }
  return less;
}

const Wrench& Limiter::limit(const Wrench& F, const Wrench& impulse, const Twist& V,
                             const Wrench& weight) noexcept {
  portion_ = std::clamp(portion_ + (wanted_ ? rise_step_ : -fade_step_), 0.0, 1.0);
  met_non_finite_ = !F.allFinite() || !impulse.allFinite();
  limited_by_ = ForceLimit::kNone;
  if (met_non_finite_) {
    cut();
    return command_;
  }
  const double force_limit = std::min(budget_.max_force, warmth_.allowed());
  const Vector3 most_force = shortened(F.head<3>(), force_limit);
  const Vector3 most_torque = shortened(F.tail<3>(), budget_.max_torque);
  if (most_force != F.head<3>()) limited_by_ = ForceLimit::kForce;
  // A device that takes no torque meets no limit.
  const bool less_torque = budget_.max_torque > 0 && most_torque != F.tail<3>();
  if (less_torque) limited_by_ = ForceLimit::kTorque;
  if (portion_ < 1) limited_by_ = ForceLimit::kFade;

  if (!wanted_) spreader_.forget();
  Wrench wanted;
  wanted << portion_ * most_force, portion_ * most_torque;
  const Wrench beside = spreader_.plan(portion_ * impulse, wanted);
  weight_ << share_of(weight.head<3>(), F.head<3>(), wanted.head<3>()),
      share_of(weight.tail<3>(), F.tail<3>(), wanted.tail<3>());
  wanted += limit_power(wanted + beside, V) - (wanted + beside);
  const Wrench change = wanted + beside - command_;
  const double force = portion_of(change.head<3>(), budget_.max_force_step);
  const double torque = portion_of(change.tail<3>(), budget_.max_torque_step);
  Wrench rendered;
  rendered << between(spreader_.wrench().head<3>(), beside.head<3>(), force),
      between(spreader_.wrench().tail<3>(), beside.tail<3>(), torque);
  spreader_.render(rendered);
  steady_ << between(steady_.head<3>(), wanted.head<3>(), force),
      between(steady_.tail<3>(), wanted.tail<3>(), torque);
  command_ = steady_ + rendered;
  const bool reached = force == 1 && torque == 1;
  if (limited_by_ == ForceLimit::kNone && !reached) limited_by_ = ForceLimit::kRate;
  return command_;
}

}  // namespace hlm::server
