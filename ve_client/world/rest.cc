#include "hlm/ve_client/world/rest.h"

#include <algorithm>

namespace hlm::ve {
namespace {

/// A body is still while none of its points is faster, m/s. Lower, and bodies that the solver lets
/// tremble never rest; higher stops what creeps.
constexpr double kStill = 2e-3;
/// Time that bodies are still before they rest, s. Less lets a body hang at the top of its flight
/// against a wall.
constexpr double kStillTime = 0.5;
/// The same at first, for most of what a file places lies still: less takes what begins to slide
/// or tip slowly for still.
constexpr double kFirstStillTime = 0.1;

}  // namespace

Rest::Rest(const WorldDescription& description, const std::vector<bool>& movable)
    : state_(description.bodies.size()) {
  for (int body = 0; body < static_cast<int>(movable.size()); ++body) {
    if (!movable[at(body)]) continue;
    wake(body);
    state_[at(body)].still = kStillTime - kFirstStillTime;
  }
  for (const JointDescription& joint : description.joints) {
    state_[at(joint.child)].jointed = true;
    if (joint.parent >= 0) state_[at(joint.parent)].jointed = true;
  }
}

void Rest::wake(int body) {
  State& state = state_[at(body)];
  if (state.awake) return;
  state.awake = true;
  state.still = 0;
  awake_.push_back(body);
}

void Rest::put_to_rest(int body) {
  state_[at(body)].awake = false;
  std::erase(awake_, body);
}

int Rest::island_of(int body) {
  while (state_[at(body)].island != body) {
    int& next = state_[at(body)].island;
    next = state_[at(next)].island;
    body = next;
  }
  return body;
}

std::vector<int> Rest::settle(double dt, const std::function<double(int body)>& speed) {
  for (const int body : awake_) {
    State& state = state_[at(body)];
    state.still = speed(body) > kStill ? 0 : state.still + dt;
    state.island = body;
    state.borne = false;
    state.restless = false;
  }
  for (const auto& [first, second] : touching_) {
    if (is_awake(first) && is_awake(second)) {
      state_[at(island_of(first))].island = island_of(second);
    }
  }
  for (const auto& [first, second] : touching_) {
    if (is_awake(first) != is_awake(second)) {
      state_[at(island_of(is_awake(first) ? first : second))].borne = true;
    }
  }
  for (const int body : awake_) {
    const State& state = state_[at(body)];
    if (state.still < kStillTime || state.jointed) state_[at(island_of(body))].restless = true;
  }
  std::vector<int> resting;
  for (const int body : awake_) {
    const State& island = state_[at(island_of(body))];
    if (island.borne && !island.restless) resting.push_back(body);
  }
  for (const int body : resting) state_[at(body)].awake = false;
  std::erase_if(awake_, [&](int body) { return !is_awake(body); });
  return resting;
}

}  // namespace hlm::ve
