// The last gate before the device: a wrench is finite, limited in size and in rate, and fades.
#pragma once

#include "common/spatial.h"
#include "common/vocabulary.h"
#include "haptic_server/safety/force_budget.h"
#include "haptic_server/safety/impulse_spreader.h"
#include "haptic_server/safety/limiter_options.h"

namespace hlm::server {

/// How far the force has risen or faded.
enum class ForceLevel {
  kNone,  ///< Nothing is commanded.
  kSome,
  kFull,  ///< It is no longer held back.
};

class Limiter {
 public:
  /// dt: servo period, s.
  Limiter(const LimiterOptions& allowed, const DeviceRatings& device, double dt) noexcept;

  /// Where the force is heading: full where it is wanted, fading to none where it is not.
  void allow(bool wanted) noexcept { wanted_ = wanted; }
  /// No force from this very step on.
  void cut() noexcept;
  /// A session begins: what force is left falls at its rate, and new force rises from none.
  void restart() noexcept;
  ForceLevel level() const noexcept {
    if (portion_ == 1) return ForceLevel::kFull;
    const bool none = portion_ == 0 && !wanted_ && command_.isZero(0);
    return none ? ForceLevel::kNone : ForceLevel::kSome;
  }

  /// The wrench to command for the wanted one, and for an impulse (N·s, N·m·s) beside it. The
  /// wanted wrench is limited in magnitude, then scaled by the fade: in this order one far above
  /// the limit fades like any other. The impulse is spread over what is left. Their sum changes by
  /// no more per step than the budget has. What is not finite gives zero.
  const Wrench& limit(const Wrench& F, const Wrench& impulse = Wrench::Zero()) noexcept;
  /// The share of impulses in the latest limit().
  const Wrench& impulse_wrench() const noexcept { return spreader_.wrench(); }
  /// What kept the latest limit() from giving the wanted wrench.
  ForceLimit limited_by() const noexcept { return limited_by_; }
  /// Whether the latest limit() met a wrench that was not finite.
  bool met_non_finite() const noexcept { return met_non_finite_; }

 private:
  ForceBudget budget_;
  double fade_step_;    ///< Of portion_ per step.
  double rise_step_;    ///< Likewise.
  double portion_ = 0;  ///< Of the limited wrench that is rendered, 0 to 1.
  bool wanted_ = false;
  bool met_non_finite_ = false;
  ForceLimit limited_by_ = ForceLimit::kNone;
  ImpulseSpreader spreader_;
  Wrench steady_ = Wrench::Zero();   ///< The command without its impulses.
  Wrench command_ = Wrench::Zero();  ///< The latest.
};

}  // namespace hlm::server
