#include "hlm/ve_client/run/shared_bodies.h"

#include <algorithm>
#include <cmath>

#include "hlm/ve_client/world/mobility.h"

namespace hlm::ve {
namespace {

/// Mass that a shared body gains for each second of the loop, kg/s: a wave impedance. With less,
/// tools that hold a body shake it; from twice as much on its own late reports shake it.
constexpr double kImpedance = 80;
/// How much of what is new of the others reaches a server in a loop. Faster shakes the body; slower
/// lets tools that squeeze it sink in before they feel each other.
constexpr double kPerLoop = 0.3;
/// The same once they have not pushed the body for a loop: late impulses come sooner, so they have
/// left it. Slower, and what its server is given falls millimetres behind the body.
constexpr double kLeftPerLoop = 1;
/// Time constants with which that mass comes, and goes when the body is no longer shared, s. It may
/// lose touch with one of the tools for a moment.
constexpr double kTaking = 0.1;
constexpr double kLeaving = 1;
/// Added mass that is none, kg.
constexpr double kNoMass = 1e-3;
/// Frames from a report of impulses to the update that contains them.
constexpr double kFrames = 3;
/// Longest round trip that counts, s. With more a body that two tools hold gets too heavy to move.
constexpr double kLongestRoundTrip = 0.2;
/// Time constant of the mean loop, s. Shorter, and a single late packet adds mass.
constexpr double kLoopMean = 1;
/// What is less than this is nothing, N or m/s, N·m or rad/s.
constexpr double kNothing = 1e-6;

double share(double rate, double period) { return 1 - std::exp(-rate * period); }

}  // namespace

void SharedBodies::push(std::span<const Pushes> pushes, std::span<const MovableBodies> reported,
                        double period, double round_trip, bool several) {
  if (pushes.size() < 2) return;
  estimate_loop(period, round_trip);
  find_shared(pushes, reported);
  add_inertia(period, several);
  for (std::size_t tool = 0; tool < pushes.size(); ++tool) learn(tool, pushes, period);
}

void SharedBodies::estimate_loop(double period, double round_trip) {
  const double loop = std::min(round_trip, kLongestRoundTrip) + kFrames * period;
  if (loop_ == 0) loop_ = loop;
  loop_ += share(1 / kLoopMean, period) * (loop - loop_);
}

/// The bodies that a tool moves: those that it pushes, and those that these press on.
std::set<int> SharedBodies::moved(const Pushes& pushes, const MovableBodies& reported) const {
  std::set<int> moved;
  std::vector<int> pressing;
  const auto add = [&](int body) {
    if (moved.insert(body).second) pressing.push_back(body);
  };
  for (const auto& [body, F] : pushes) add(body);
  while (!pressing.empty()) {
    const int body = pressing.back();
    pressing.pop_back();
    for (const MovableBody& other : reported) {
      const int id = static_cast<int>(other.id);
      if (world_.loads().load(body, id) > 0) add(id);
    }
  }
  return moved;
}

void SharedBodies::find_shared(std::span<const Pushes> pushes,
                               std::span<const MovableBodies> reported) {
  std::map<int, int> tools_on;
  for (std::size_t i = 0; i < pushes.size(); ++i) {
    for (const int body : moved(pushes[i], reported[i])) ++tools_on[body];
  }
  now_.clear();
  for (const auto& [body, tools] : tools_on) {
    if (tools > 1) now_.push_back(body);
  }
}

/// While a body is shared its added mass never falls: what falls gives no momentum back. Where one
/// hand is left it goes at once: it has no weight, and would leave that hand as this comes to rest.
void SharedBodies::add_inertia(double period, bool several) {
  for (const int body : now_) added_.try_emplace(body, 0);
  for (auto& [body, added] : added_) {
    const bool now = std::ranges::find(now_, body) != now_.end();
    if (now) {
      added += share(1 / kTaking, period) * std::max(0.0, kImpedance * loop_ - added);
    } else {
      added -= (several ? share(1 / kLeaving, period) : 1) * added;
      if (added < kNoMass) added = 0;
    }
    const double mass = world_.description().bodies[static_cast<std::size_t>(body)].mass;
    world_.set_inertia_factor(body, 1 + added / mass);
  }
}

/// What the others do in this frame.
void SharedBodies::learn(std::size_t tool, std::span<const Pushes> pushes, double period) {
  OthersOn& others_on = of_tools_[tool];
  Pushes present;
  for (std::size_t other = 0; other < pushes.size(); ++other) {
    if (other == tool) continue;
    for (const auto& [body, F] : pushes[other]) {
      present.try_emplace(body, Wrench::Zero()).first->second += F;
      others_on.try_emplace(body);
    }
  }
  for (auto& [body, others] : others_on) {
    const Wrench F = present.try_emplace(body, Wrench::Zero()).first->second;
    others.away = F.isZero(0) ? others.away + period : 0;
    const double learnt = share((others.away > loop_ ? kLeftPerLoop : kPerLoop) / loop_, period);
    others.mean += learnt * (F - others.mean);
    others.unreported += world_.mobility_of(body).W * (F - others.mean) * period;
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
