#include "ve_client/shared_bodies.h"

#include <algorithm>
#include <cmath>

#include "ve_client/world/mobility.h"

namespace hlm::ve {
namespace {

/// Mass that a shared body gains for each second of the loop, kg/s: a wave impedance. With less,
/// tools that hold a body shake it; from twice as much on its own late reports shake it.
constexpr double kImpedance = 80;
/// How much of what is new of the others reaches a server in a loop. Faster shakes the body; slower
/// lets tools that squeeze it sink in before they feel each other.
constexpr double kPerLoop = 0.4;
/// Time constants with which a body becomes a shared one, and ceases to be, s. It may lose touch
/// with one of the tools for a moment.
constexpr double kTaking = 0.1;
constexpr double kLeaving = 1;
/// A body that is shared no more than this is not.
constexpr double kNotShared = 1e-3;
/// What is less than this is nothing, N or m/s, N·m or rad/s.
constexpr double kNothing = 1e-6;

double share(double rate, double period) { return 1 - std::exp(-rate * period); }

}  // namespace

void SharedBodies::find_shared(std::span<const Pushes> pushes,
                               std::span<const MovableBodies> reported) {
  std::map<int, int> tools_on;
  for (std::size_t i = 0; i < pushes.size(); ++i) {
    if (pushes[i].empty()) continue;
    for (const MovableBody& body : reported[i]) ++tools_on[static_cast<int>(body.id)];
  }
  now_.clear();
  for (const auto& [body, tools] : tools_on) {
    if (tools > 1) now_.push_back(body);
  }
}

void SharedBodies::push(std::span<const Pushes> pushes, std::span<const MovableBodies> reported,
                        double period, double loop) {
  if (pushes.size() < 2) return;
  find_shared(pushes, reported);
  add_inertia(period, loop);
  for (std::size_t tool = 0; tool < pushes.size(); ++tool) learn(tool, pushes, period, loop);
}

void SharedBodies::add_inertia(double period, double loop) {
  for (const int body : now_) shared_.try_emplace(body, 0);
  for (auto& [body, part] : shared_) {
    const bool now = std::ranges::find(now_, body) != now_.end();
    part += now ? (1 - part) * share(1 / kTaking, period) : -part * share(1 / kLeaving, period);
    if (!now && part < kNotShared) part = 0;
    const double mass = world_.description().bodies[static_cast<std::size_t>(body)].mass;
    world_.set_inertia_factor(body, 1 + part * kImpedance * loop / mass);
  }
}

/// What the others do in this frame.
void SharedBodies::learn(std::size_t tool, std::span<const Pushes> pushes, double period,
                         double loop) {
  OthersOn& others_on = of_tools_[tool];
  Pushes present;
  for (std::size_t other = 0; other < pushes.size(); ++other) {
    if (other == tool) continue;
    for (const auto& [body, F] : pushes[other]) {
      present.try_emplace(body, Wrench::Zero()).first->second += F;
      others_on.try_emplace(body);
    }
  }
  const double learnt = share(kPerLoop / loop, period);
  for (auto& [body, others] : others_on) {
    const Wrench F = present.try_emplace(body, Wrench::Zero()).first->second;
    others.mean += learnt * (F - others.mean);
    others.unreported += mobility_of(world_, body).W * (F - others.mean) * period;
    others.unreported -= learnt * others.unreported;
  }
  std::erase_if(others_on, [&](const auto& entry) {
    const auto& [body, others] = entry;
    return present.at(body).isZero(0) && others.mean.norm() < kNothing &&
           others.unreported.norm() < kNothing;
  });
}

void SharedBodies::add_others(std::size_t tool, MovableBodies& bodies) const {
  for (MovableBody& body : bodies) {
    const auto found = of_tools_[tool].find(static_cast<int>(body.id));
    if (found == of_tools_[tool].end()) continue;
    body.V_W -= found->second.unreported;
    body.A_W += body.W * found->second.mean;
  }
}

}  // namespace hlm::ve
