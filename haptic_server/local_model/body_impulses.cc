#include "hlm/haptic_server/local_model/body_impulses.h"

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

void BodyImpulses::report(const Slots& evenly) noexcept {
  if (!evenly.empty()) even_out(evenly);
  for (Total& total : totals_) total.reported_W = total.P_W;
  reported_ = step_;
}

/// Spreads what these bodies got since the report before over its steps. A body's first impulses,
/// of which that report knows nothing, are played out at once.
void BodyImpulses::even_out(const Slots& slots) noexcept {
  const std::uint64_t first = std::max(reported_, oldest()) + 1;
  const auto steps = static_cast<double>(step_ + 1 - first);
  for (const std::size_t slot : slots) {
    const auto is_of_slot = [slot](const Impulse& impulse) { return impulse.slot == slot; };
    const auto has_room = [&](std::uint64_t step) {
      return at(step).size() < at(step).capacity() || std::ranges::any_of(at(step), is_of_slot);
    };
    bool fits = true;
    for (std::uint64_t step = first; step <= step_; ++step) fits = fits && has_room(step);
    if (!fits) continue;  // Other bodies have all places of a step.
    const Vector6 sum = between(slot, first - 1, step_);
    const bool at_once = totals_[slot].reported_W.isZero(0);
    for (std::uint64_t step = first; step <= step_; ++step) {
      erase_if(at(step), is_of_slot);
      if (at_once && step > first) continue;
      at(step).push_back({slot, at_once ? sum : Vector6(sum / steps)});
    }
  }
}

void BodyImpulses::begin_silence() noexcept {
  for (Total& total : totals_) total.P_W = total.reported_W;
  left_out_before_ = left_out_;
  left_out_ += step_ - reported_;
  step_ = silence_ = reported_;
  at(step_ + 1).clear();
  silent_ = true;
}

void BodyImpulses::repeat(std::uint64_t steps) noexcept {
  if (silent_) {
    left_out_ += steps;
    return;
  }
  const Step latest = at(step_);
  step_ += steps;
  for (const auto& [slot, P_W] : latest) {
    totals_[slot].P_W += static_cast<double>(steps) * P_W;
    totals_[slot].last_step = step();
  }
  const std::uint64_t remembered = std::min(steps, kHistory - 1);
  for (std::uint64_t i = 0; i < remembered; ++i) at(step_ - i) = latest;
  at(step_ + 1).clear();
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
