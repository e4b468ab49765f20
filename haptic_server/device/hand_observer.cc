#include "hlm/haptic_server/device/hand_observer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hlm/haptic_server/device/saturate.h"

namespace hlm::server {
namespace {

double inverse(double inertia) noexcept { return inertia > 0 ? 1 / inertia : 0; }

Pose moved(const Pose& X, const Vector6& moves) noexcept {
  return {X.p + moves.head<3>(), (rotation_from_vector(moves.tail<3>()) * X.R).normalized()};
}

/// Shares of the distance that go into pose, twist and wrench.
struct Gains {
  double pose;
  double twist;
  double force;
};

/// The poles of a Butterworth filter: -w and w (-1 ± i√3)/2, in z.
Gains gains_of(double bandwidth, double dt) noexcept {
  const double angle = 2 * std::numbers::pi * bandwidth * dt;
  const double real = std::exp(-angle);
  const double size = std::exp(-angle / 2);  // of the pair
  const double sum = 2 * size * std::cos(std::sqrt(3.0) / 2 * angle);
  // Those of the error are the roots of z³ + (α + β + γ/2 - 3) z² + (3 - 2α - β + γ/2) z + α - 1.
  Gains gains;
  gains.pose = 1 - real * size * size;
  gains.force = (1 - real) * (1 - sum + size * size);
  gains.twist = 3 - real - sum - gains.pose - gains.force / 2;
  return gains;
}

/// Largest change of the estimate right at one encoder step, N. Less follows the hand later, more
/// is felt as a hum at rest.
constexpr double kQuietStep = 0.05;

}  // namespace

double quiet_bandwidth(const DeviceRatings& device, double asked, double dt) noexcept {
  constexpr double kSlower = 0.95;  // Between two tries.
  double bandwidth = asked;
  const double step = device.mass * device.position_step / (dt * dt);
  while (step * gains_of(bandwidth, dt).force > kQuietStep && bandwidth > 1) bandwidth *= kSlower;
  return bandwidth;
}

HandObserver::HandObserver(const DeviceRatings& device, double bandwidth, double dt)
    : mobility_(diagonal(inverse(device.mass), inverse(device.inertia))),
      inertia_(diagonal(device.mass, device.inertia)),
      damping_(diagonal(device.damping, 0)),
      max_force_(device.max_force),
      max_torque_(device.max_torque),
      dt_(dt),
      commands_(1 + static_cast<std::size_t>(std::lround(device.delay / dt))) {
  for (Eigen::Index i = 0; i < 6; ++i) {
    if ((device.freedoms >> i & 1) == 0) mobility_[i] = inertia_[i] = 0;
  }
  const Gains gains = gains_of(bandwidth, dt);
  pose_gain_ = gains.pose;
  twist_gain_ = gains.twist / dt;
  force_gain_ = gains.force / (dt * dt);
  restart(Pose{});
}

void HandObserver::restart(const Pose& X_WD) noexcept {
  X_WM_ = X_WD;
  V_WM_.setZero();
  F_.setZero();
  std::ranges::fill(commands_, Wrench::Zero());
}

void HandObserver::command(const Wrench& F) noexcept {
  newest_ = (newest_ + 1) % commands_.size();
  commands_[newest_] = F;
}

const Wrench& HandObserver::observe(const Pose& X_WD, bool powered) noexcept {
  const Wrench& due = commands_[(newest_ + 1) % commands_.size()];
  const Wrench F_motor = powered ? due : Wrench(Wrench::Zero());
  const Twist A = mobility_.cwiseProduct(F_motor + F_ - damping_.cwiseProduct(V_WM_));
  X_WM_ = moved(X_WM_, dt_ * V_WM_ + dt_ * dt_ / 2 * A);
  V_WM_ += dt_ * A;
  const Vector6 away = displacement(X_WM_, X_WD);
  X_WM_ = moved(X_WM_, pose_gain_ * away);
  V_WM_ += twist_gain_ * away;
  F_ = saturated(F_ + force_gain_ * inertia_.cwiseProduct(away), max_force_, max_torque_);
  return F_;
}

}  // namespace hlm::server
