#include "hlm/haptic_server/device/simulated_device.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "hlm/haptic_server/device/saturate.h"

namespace hlm::server {
namespace {

/// Longest substep, s. A stiff hand (20 kN/m) on a light device (50 g) still has ten substeps to
/// its radian; longer ones would let it oscillate, shorter ones only cost time.
constexpr double kLongestSubstep = 1e-4;

double rounded(double value, double step) noexcept {
  return step > 0 ? step * std::round(value / step) : value;
}

/// Zero in the directions in which the handle cannot move.
Wrench within(DeviceFreedom freedom, const Wrench& F) noexcept {
  if (freedom == DeviceFreedom::kSpatial) return F;
  Wrench planar = Wrench::Zero();
  planar << F[0], F[1], 0, 0, 0, F[5];
  return planar;
}

}  // namespace

DeviceRatings ratings_of(const SimulatedDeviceOptions& options) noexcept {
  return {.max_force = options.max_force,
          .max_torque = options.max_torque,
          .max_force_rate = options.max_force_rate,
          .max_torque_rate = options.max_torque_rate,
          .max_stiffness = options.max_stiffness,
          .max_angular_stiffness = options.max_angular_stiffness,
          .mass = options.mass,
          .inertia = options.inertia,
          .damping = options.damping,
          .freedoms = options.freedom == DeviceFreedom::kPlanar ? kPlanarFreedoms : kAllFreedoms,
          .time_guard = options.amplifier.empty() ? 0 : std::numeric_limits<double>::infinity(),
          .halts = true};
}

std::optional<std::string> find_error(const SimulatedDeviceOptions& options) {
  if (auto error = find_error(options, kSimulatedDeviceNumbers)) return error;
  return find_error("delay", options.delay, kDeviceDelays);
}

SimulatedDevice::Kick SimulatedDevice::kick(double inertia, double damping, double friction,
                                            double h) noexcept {
  const double decay = std::exp(-damping * h / inertia);
  return {decay, damping > 0 ? -std::expm1(-damping * h / inertia) / damping : h / inertia,
          friction};
}

/// Dry friction takes speed away, down to none: it never reverses the motion.
Vector3 SimulatedDevice::Kick::velocity(const Vector3& v, const Vector3& F) const noexcept {
  const Vector3 frictionless = decay * v + gain * F;
  const double speed = frictionless.norm();
  const double loss = gain * friction;
  return speed > loss ? Vector3(frictionless * (1 - loss / speed)) : Vector3::Zero();
}

SimulatedDevice::SimulatedDevice(const SimulatedDeviceOptions& options, HandScript hand, double dt)
    : options_(options),
      ratings_(ratings_of(options)),
      hand_(std::move(hand)),
      dt_(dt),
      substeps_(static_cast<int>(std::ceil(dt / kLongestSubstep))),
      h_(dt / substeps_),
      linear_(kick(options.mass, options.damping, options.dry_friction, h_)),
      angular_(kick(options.inertia, options.angular_damping, options.dry_friction_torque, h_)),
      filter_gain_(-std::expm1(-2 * std::numbers::pi * options.velocity_cutoff * dt)),
      amplifier_(options.amplifier) {
  assert(!find_error(options) && dt > 0);
  ratings_.delay = options.delay * dt;
  align(Pose{});
  ratings_.gripper = hand_.opening(0).has_value();
  enable();
  disable();
}

std::string_view SimulatedDevice::name() const noexcept {
  return options_.freedom == DeviceFreedom::kPlanar ? "simulated planar device"
                                                    : "simulated spatial device";
}

void SimulatedDevice::align(const Pose& X_WH) noexcept {
  steps_ = 0;
  X_WStart_ = X_WD_ = X_WD_sensed_ = X_WH;
  V_WD_ = V_WD_sensed_ = Twist::Zero();
  hand_.start(X_WH);
  X_WGuide_.reset();
  saturated_ = false;
}

void SimulatedDevice::enable() noexcept {
  enabled_ = true;
  amplifier_.resume();
  commands_.fill(Wrench::Zero());
}

void SimulatedDevice::disable() noexcept {
  enabled_ = false;
  amplifier_.give(Wrench::Zero());
}

std::optional<DeviceState> SimulatedDevice::read() noexcept {
  DeviceState state;
  state.X_WD = X_WD_sensed_;
  state.V_WD = V_WD_sensed_;
  state.gripper = hand_.opening(static_cast<double>(steps_) * h_);
  if (saturated_) state.health = DeviceHealth::kSaturated;
  if (!options_.switched_on) state.health = DeviceHealth::kForceOff;
  if (options_.measures_hand_wrench) {
    state.F_hand = hand_wrench(static_cast<double>(steps_) * h_);
  }
  return state;
}

bool SimulatedDevice::write(const Wrench& F) noexcept {
  if (!F.allFinite()) return false;
  const Wrench F_motor = motor_wrench(F);
  for (int i = 0; i < substeps_; ++i) substep(F_motor);
  sense();
  return true;
}

Wrench SimulatedDevice::motor_wrench(const Wrench& commanded) noexcept {
  newest_ = (newest_ + 1) % commands_.size();
  commands_[newest_] = commanded;
  saturated_ = false;
  if (!enabled_ || !options_.switched_on) return amplifier_.give(Wrench::Zero());
  const std::size_t behind = static_cast<std::size_t>(options_.delay);
  const Wrench& due = commands_[(newest_ + commands_.size() - behind) % commands_.size()];
  const Wrench given = saturated(due, options_.max_force, options_.max_torque);
  constexpr double kRounding = 1e-12;
  saturated_ = !given.isApprox(due, kRounding);
  return amplifier_.give(given);
}

Wrench SimulatedDevice::hand_wrench(double t) const noexcept {
  const Wrench F = X_WGuide_ ? grip_wrench(Grip{}, displacement(X_WD_, *X_WGuide_), -V_WD_)
                             : hand_.wrench(t, X_WD_, V_WD_);
  return within(options_.freedom, F);
}

void SimulatedDevice::drift(double h) noexcept {
  X_WD_.p += h * V_WD_.head<3>();
  X_WD_.R = (rotation_from_vector(h * V_WD_.tail<3>()) * X_WD_.R).normalized();
}

/// Half a drift, the kick of all wrenches there, half a drift: second order, and exact for a
/// constant wrench without damping.
void SimulatedDevice::substep(const Wrench& F_motor) noexcept {
  drift(h_ / 2);
  const double t = (static_cast<double>(steps_) + 0.5) * h_;
  const Wrench F = within(options_.freedom, F_motor) + hand_wrench(t);
  V_WD_ << linear_.velocity(V_WD_.head<3>(), F.head<3>()),
      angular_.velocity(V_WD_.tail<3>(), F.tail<3>());
  drift(h_ / 2);
  ++steps_;
  hand_.advance(static_cast<double>(steps_) * h_, X_WD_);
}

bool SimulatedDevice::senses_exactly() const noexcept {
  return options_.position_step == 0 && options_.angle_step == 0 &&
         std::isinf(options_.velocity_cutoff);
}

Pose SimulatedDevice::quantised(const Pose& X_WD) const noexcept {
  if (options_.position_step == 0 && options_.angle_step == 0) return X_WD;
  Vector6 e = displacement(X_WStart_, X_WD);
  for (Eigen::Index i = 0; i < 3; ++i) {
    e[i] = rounded(e[i], options_.position_step);
    e[i + 3] = rounded(e[i + 3], options_.angle_step);
  }
  return {X_WStart_.p + e.head<3>(), rotation_from_vector(e.tail<3>()) * X_WStart_.R};
}

void SimulatedDevice::sense() noexcept {
  const Pose X_before = X_WD_sensed_;
  X_WD_sensed_ = quantised(X_WD_);
  if (senses_exactly()) {
    V_WD_sensed_ = V_WD_;
    return;
  }
  const Twist difference = displacement(X_before, X_WD_sensed_) / dt_;
  V_WD_sensed_ += filter_gain_ * (difference - V_WD_sensed_);
}

}  // namespace hlm::server
