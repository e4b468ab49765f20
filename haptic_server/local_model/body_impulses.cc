#include "haptic_server/local_model/body_impulses.h"

#include <algorithm>

namespace hlm::server {

std::optional<std::size_t> BodyImpulses::enrol(std::uint32_t body) noexcept {
  for (std::size_t slot = 0; slot < totals_.size(); ++slot) {
    if (totals_[slot].body == body) return slot;
  }
  if (totals_.size() == totals_.capacity()) return std::nullopt;
  totals_.push_back({body, Vector6::Zero(), 0});
  return totals_.size() - 1;
}

void BodyImpulses::add(std::size_t slot, const Vector6& P_W) noexcept {
  totals_[slot].P_W += P_W;
  totals_[slot].last_step = step_ + 1;
  Step& present = at(step_ + 1);
  for (Impulse& impulse : present) {
    if (impulse.slot != slot) continue;
    impulse.P_W += P_W;
    return;
  }
  present.push_back({slot, P_W});
}

void BodyImpulses::end_step() noexcept {
  ++step_;
  at(step_ + 1).clear();
}

Vector6 BodyImpulses::between(std::size_t slot, std::uint64_t from,
                              std::uint64_t to) const noexcept {
  Vector6 sum = Vector6::Zero();
  for (std::uint64_t step = std::max(from, oldest()) + 1; step <= std::min(to, step_); ++step) {
    for (const Impulse& impulse : at(step)) {
      if (impulse.slot == slot) sum += impulse.P_W;
    }
  }
  return sum;
}

}  // namespace hlm::server
