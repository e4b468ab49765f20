#include "haptic_server/control/impulse_spreader.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {
namespace {

/// Longest time at full force, s, that pending impulses may take. A hand feels about 20 ms as one
/// event; more would push on after the contact is over.
constexpr double kLongestRendering = 0.02;

/// Largest a in [0, 1] with |f + a g| <= limit; 0 if f alone exceeds it outwards.
double portion_within(const Vector3& f, const Vector3& g, double limit) noexcept {
  const double gg = g.squaredNorm();
  if (!std::isfinite(limit) || gg == 0) return 1;
  const double fg = f.dot(g);
  const double root = fg * fg + gg * (limit * limit - f.squaredNorm());
  return root <= 0 ? 0 : std::clamp((std::sqrt(root) - fg) / gg, 0.0, 1.0);
}

/// Largest portion of an impulse that `limit` renders within kLongestRendering.
double portion_in_time(const Vector3& impulse, double limit) noexcept {
  const double size = impulse.norm();
  return size > limit * kLongestRendering ? limit * kLongestRendering / size : 1;
}

}  // namespace

ImpulseSpreader::ImpulseSpreader(const ForceBudget& budget, double dt) noexcept
    : budget_(budget), dt_(dt) {}

Wrench ImpulseSpreader::render(const Wrench& impulse, const Wrench& F) noexcept {
  pending_ += impulse;
  // What a device without torque cannot render must not hold back what it can.
  if (budget_.max_torque == 0) pending_.tail<3>().setZero();
  const double longest = std::min(portion_in_time(pending_.head<3>(), budget_.max_force),
                                  portion_in_time(pending_.tail<3>(), budget_.max_torque));
  if (longest < 1) pending_ *= longest;

  const Wrench whole = pending_ / dt_;
  const double portion = std::min(portion_within(F.head<3>(), whole.head<3>(), budget_.max_force),
                                  portion_within(F.tail<3>(), whole.tail<3>(), budget_.max_torque));
  pending_ *= 1 - portion;
  return portion * whole;
}

}  // namespace hlm::server
