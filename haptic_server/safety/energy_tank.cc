#include "hlm/haptic_server/safety/energy_tank.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {

void EnergyTank::observe(const Pose& X_WD, const Wrench& F, const Wrench& weight,
                         double supply) noexcept {
  if (known_) {
    const Vector6 moves = displacement(X_WD_, X_WD);
    const double given = work_at_handle(F, moves, scale_);
    (given > 0 ? ledger_.given : ledger_.taken) += std::abs(given);
    const double level = ledger_.tank - given;
    const double explained = explain(level, work_at_handle(weight, moves, scale_), supply);
    ledger_.explained += explained;
    ledger_.tank = std::min(level + explained, limits_.capacity);  // in this order NaN stays NaN
  }
  known_ = true;
  X_WD_ = X_WD;
}

/// The part of a period's explanations that changes a tank of that level, J.
double EnergyTank::explain(double level, double weight, double supply) noexcept {
  const double sum = weight + supply;
  if (!(sum > 0)) {
    // What went elsewhere than to the hand makes nothing owed.
    const double kept = std::max(sum, std::min(-level, 0.0));
    const double lifts = std::clamp(weight, kept, 0.0);
    lifted_ = std::min(lifted_ - lifts, limits_.claim);
    claim_ = std::min(claim_ - (kept - lifts), limits_.claim);
    return kept;
  }
  const double lacks = std::min(sum, std::max(limits_.capacity - level, 0.0));
  const double lowers = std::clamp(weight, 0.0, std::min(lacks, lifted_));
  const double claims = std::min(lacks - lowers, claim_);
  lifted_ -= lowers;
  claim_ -= claims;
  return lowers + claims;
}

}  // namespace hlm::server
