// Renders collision impulses within the force budget (docs/method.md 5.4, Eq. 12).
#pragma once

#include "common/spatial.h"
#include "haptic_server/control/force_budget.h"

namespace hlm::server {

/// An impulse that would need more force in one step than there is is spread over as many
/// steps as it takes, keeping its direction and momentum.
class ImpulseSpreader {
 public:
  /// dt: servo period, s.
  ImpulseSpreader(const ForceBudget& budget, double dt) noexcept;

  /// Adds `impulse` (N·s, N·m·s) and returns the wrench of this step: as much of what is pending as
  /// fits beside F, the wrench already commanded.
  Wrench render(const Wrench& impulse, const Wrench& F) noexcept;

  /// Momentum still to be rendered, N·s and N·m·s.
  const Wrench& pending() const noexcept { return pending_; }
  void clear() noexcept { pending_.setZero(); }

 private:
  ForceBudget budget_;
  double dt_;
  Wrench pending_ = Wrench::Zero();
};

}  // namespace hlm::server
