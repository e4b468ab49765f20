// Renders collision impulses within the force budget (docs/method.md 5.4, Eq. 12).
#pragma once

#include "hlm/common/spatial.h"
#include "hlm/haptic_server/safety/force_budget.h"

namespace hlm::server {

/// An impulse that would need more force, or more change of force, in one step than there is
/// is spread over as many steps as it takes, keeping its direction and momentum: the force rises
/// and falls at the budget's rate.
class ImpulseSpreader {
 public:
  /// dt: servo period, s.
  ImpulseSpreader(const ForceBudget& budget, double dt) noexcept;

  /// Adds `impulse` (N·s, N·m·s) and returns the wrench that would render what is pending: as much
  /// as fits next to F, the wrench that is wanted without it, and can still come down in time.
  Wrench plan(const Wrench& impulse, const Wrench& F) noexcept;
  /// Says that this much of it is rendered in this step.
  void render(const Wrench& wrench) noexcept;

  /// Wrench of the latest step.
  const Wrench& wrench() const noexcept { return wrench_; }
  /// Momentum still to be rendered, N·s and N·m·s.
  const Wrench& pending() const noexcept { return pending_; }
  /// What is pending will not be rendered.
  void forget() noexcept { pending_.setZero(); }
  /// No wrench from now on.
  void clear() noexcept;

 private:
  ForceBudget budget_;
  double dt_;
  Wrench pending_ = Wrench::Zero();
  Wrench wrench_ = Wrench::Zero();
};

}  // namespace hlm::server
