#include "haptic_server/local_model/body_impulses.h"

#include <algorithm>

namespace hlm::server {
namespace {

template <class List>
auto find(List& list, std::uint32_t body) noexcept {
  return std::find_if(list.begin(), list.end(),
                      [body](const auto& entry) { return entry.body == body; });
}

}  // namespace

bool BodyImpulses::enrol(std::uint32_t body) noexcept {
  if (find(totals_, body) != totals_.end()) return true;
  if (totals_.size() == totals_.capacity()) return false;
  totals_.push_back({body, Vector6::Zero(), 0});
  return true;
}

void BodyImpulses::add(std::uint32_t body, const Vector6& P_W) noexcept {
  const auto total = find(totals_, body);
  if (total == totals_.end()) return;
  total->P_W += P_W;
  total->last_step = step_ + 1;
  Step& present = at(step_ + 1);
  const auto impulse = find(present, body);
  if (impulse != present.end()) {
    impulse->P_W += P_W;
  } else {
    present.push_back({body, P_W});
  }
}

void BodyImpulses::end_step() noexcept {
  ++step_;
  at(step_ + 1).clear();
}

Vector6 BodyImpulses::total(std::uint32_t body) const noexcept {
  const auto total = find(totals_, body);
  return total != totals_.end() ? total->P_W : Vector6(Vector6::Zero());
}

Vector6 BodyImpulses::between(std::uint32_t body, std::uint64_t from,
                              std::uint64_t to) const noexcept {
  Vector6 sum = Vector6::Zero();
  for (std::uint64_t step = std::max(from, oldest()) + 1; step <= std::min(to, step_); ++step) {
    const auto impulse = find(at(step), body);
    if (impulse != at(step).end()) sum += impulse->P_W;
  }
  return sum;
}

}  // namespace hlm::server
