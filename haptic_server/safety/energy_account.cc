#include "hlm/haptic_server/safety/energy_account.h"

#include <algorithm>

#include "hlm/haptic_server/safety/model_energy.h"

namespace hlm::server {

void EnergyAccount::begin() noexcept {
  hand_work_.begin();
  supply_ = in_proxy_ = brought_ = 0;
}

void EnergyAccount::step(const LocalModel& model, const Pose& X_WP, const Wrench& F_hand,
                         bool observed, double moved, bool twice) noexcept {
  const ToolModel& proxy = model.proxy();
  double hand = work_at_handle(F_hand, displacement(X_WP, proxy.X_WH()), scale_);
  if (observed) hand = hand_work_.credited(hand);
  const double load = model.load().dot(model.velocity()) * dt_ / scale_;
  in_proxy_ += hand + load + (twice ? 2 : 1) * moved;
  const double kept = std::clamp(in_proxy_, 0.0, kinetic_energy(model) / scale_);
  supply_ = in_proxy_ - kept;
  in_proxy_ = kept;
}

}  // namespace hlm::server
