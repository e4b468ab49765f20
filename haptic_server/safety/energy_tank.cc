#include "hlm/safety/energy_tank.h"

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
    // What went elsewhere than to the hand makes nothing owed.
    const double explained =
        std::max(work_at_handle(weight, moves, scale_) + supply, std::min(-level, 0.0));
    ledger_.explained += explained;
    ledger_.tank = std::min(level + explained, capacity_);  // in this order NaN stays NaN
  }
  known_ = true;
  X_WD_ = X_WD;
}

void EnergyTank::rest(double time) noexcept {
  ledger_.tank = std::min(ledger_.tank + time * capacity_ / kRefillTime, capacity_);  // as above
}

}  // namespace hlm::server
