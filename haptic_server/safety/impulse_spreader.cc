#include "hlm/haptic_server/safety/impulse_spreader.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {
namespace {

/// Longest time at full force, s, that pending impulses may take. A hand feels about 20 ms as one
/// event; more would push on after the contact is over.
constexpr double kLongestRendering = 0.02;

/// The greatest first term of a series that falls by `step` and sums up to `sum`: from that force
/// on the rate brings it down to zero just as the momentum is spent.
double peak_of(double sum, double step) noexcept {
  if (sum <= step) return sum;
  const double terms = std::ceil((std::sqrt(1 + 8 * sum / step) - 1) / 2);
  return sum / terms + step * (terms - 1) / 2;
}

/// Largest a in [0, 1] with |f + a g| <= limit; 0 if f alone exceeds it outwards.
double portion_within(const Vector3& f, const Vector3& g, double limit) noexcept {
  const double gg = g.squaredNorm();
  if (!std::isfinite(limit) || gg == 0) return 1;
  const double fg = f.dot(g);
  const double root = fg * fg + gg * (limit * limit - f.squaredNorm());
  return root <= 0 ? 0 : std::clamp((std::sqrt(root) - fg) / gg, 0.0, 1.0);
}

/// The force, or torque, for a pending impulse, which is cut to what is rendered in time.
Vector3 planned(Eigen::Ref<Vector3> pending, const Vector3& F, double limit, double step,
                double dt) noexcept {
  const double size = pending.norm();
  if (size == 0) return Vector3::Zero();
  const double most = limit * kLongestRendering;
  if (size > most) pending *= most / size;
  const double whole = std::min(size, most) / dt;
  const Vector3 force = pending / dt * (peak_of(whole, step) / whole);
  return portion_within(F, force, limit) * force;
}

}  // namespace

ImpulseSpreader::ImpulseSpreader(const ForceBudget& budget, double dt) noexcept
    : budget_(budget), dt_(dt) {}

Wrench ImpulseSpreader::plan(const Wrench& impulse, const Wrench& F) noexcept {
  pending_ += impulse;
  // What a device without torque cannot render must not stay for ever.
  if (budget_.max_torque == 0) pending_.tail<3>().setZero();
  Wrench wrench;
  wrench << planned(pending_.head<3>(), F.head<3>(), budget_.max_force, budget_.max_force_step,
                    dt_),
      planned(pending_.tail<3>(), F.tail<3>(), budget_.max_torque, budget_.max_torque_step, dt_);
  return wrench;
}

void ImpulseSpreader::render(const Wrench& wrench) noexcept {
  constexpr double kRounding = 1e-15;
  wrench_ = wrench;
  pending_ -= wrench * dt_;
  if (pending_.head<3>().norm() <= kRounding) pending_.head<3>().setZero();
  if (pending_.tail<3>().norm() <= kRounding) pending_.tail<3>().setZero();
}

void ImpulseSpreader::clear() noexcept {
  pending_.setZero();
  wrench_.setZero();
}

}  // namespace hlm::server
