#include "hlm/local_model/body_impulses.h"

#include <algorithm>

namespace hlm::server {

std::optional<std::size_t> BodyImpulses::enrol(std::uint32_t body) noexcept {
  for (std::size_t slot = 0; slot < totals_.size(); ++slot) {
    if (totals_[slot].body == body) return slot;
  }
  if (totals_.size() == totals_.capacity()) return std::nullopt;
  totals_.push_back({.body = body});
  return totals_.size() - 1;
}

void BodyImpulses::add(std::size_t slot, const Vector6& P_W) noexcept {
  totals_[slot].P_W += P_W;
  totals_[slot].last_step = step() + 1;
  Step& present = at(step_ + 1);
  for (Impulse& impulse : present) {
    if (impulse.slot != slot) continue;
    impulse.P_W += P_W;
    return;
  }
  present.push_back({slot, P_W});
}

void BodyImpulses::report() noexcept {
  for (Total& total : totals_) total.reported_W = total.P_W;
  reported_ = step_;
}

void BodyImpulses::begin_silence() noexcept {
  for (Total& total : totals_) total.P_W = total.reported_W;
  left_out_before_ = left_out_;
  left_out_ += step_ - reported_;
  step_ = silence_ = reported_;
  at(step_ + 1).clear();
  silent_ = true;
}

double BodyImpulses::world_step(double step) const noexcept {
  const auto silence = static_cast<double>(silence_);
  const double after = step - static_cast<double>(left_out_);
  return after >= silence ? after : std::min(step - static_cast<double>(left_out_before_), silence);
}

void BodyImpulses::end_step() noexcept {
  if (silent_) {
    ++left_out_;
    return;
  }
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
