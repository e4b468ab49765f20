// The last gate before the device: a wrench is finite, limited in size and in rate, and fades.
#pragma once

#include "common/spatial.h"
#include "common/vocabulary.h"
#include "haptic_server/control/force_budget.h"

namespace hlm::server {

struct LimiterOptions {
  double max_force = 12;    ///< N; the device's rating counts too.
  double max_torque = 0.6;  ///< N·m; the device's rating counts too.
  double fade_time = 0.1;   ///< From full force to none and back, s.
};

class Limiter {
 public:
  /// fade_time: from full force to none and back, s; dt: servo period, s.
  Limiter(const ForceBudget& budget, double fade_time, double dt) noexcept;

  /// Where the force is heading: full where it is wanted, fading to none where it is not.
  void allow(bool wanted) noexcept { wanted_ = wanted; }
  /// No force from this very step on.
  void cut() noexcept;
  /// Whether the force has faded to nothing.
  bool silent() const noexcept { return portion_ == 0 && !wanted_ && previous_.isZero(0); }

  /// The wrench to command for the wanted one: limited in magnitude, then scaled by the fade, then
  /// limited in change per step; direction of force and of torque kept. In this order a wanted
  /// wrench far above the limit fades like any other. A wrench that is not finite gives zero.
  Wrench limit(const Wrench& F) noexcept;
  /// What kept the latest limit() from giving the wanted wrench.
  ForceLimit limited_by() const noexcept { return limited_by_; }
  /// Whether the latest limit() met a wrench that was not finite.
  bool met_non_finite() const noexcept { return met_non_finite_; }

 private:
  ForceBudget budget_;
  double fade_step_;    ///< Of portion_ per step.
  double portion_ = 0;  ///< Of the limited wrench that is rendered, 0 to 1.
  bool wanted_ = false;
  bool met_non_finite_ = false;
  ForceLimit limited_by_ = ForceLimit::kNone;
  Wrench previous_ = Wrench::Zero();
};

}  // namespace hlm::server
