// What the servo waits for, and for how long. How long nothing is heard of the client, the state
// machine counts (haptic_server/safety/state_machine.h).
#pragma once

#include <algorithm>

#include "hlm/haptic_server/loop/timing.h"

namespace hlm::server {

/// Counted in periods, not read from a clock, so that a replay finds the same.
class Clocks {
 public:
  /// Time without a guard that is a fault, s: a guard that is only kept waiting is back before.
  static constexpr double kLongestUnguarded = 0.5;
  /// Time that ticks with a scene may take beyond their period, s, less what others leave of
  /// theirs: more than a busy machine's stalls.
  static constexpr double kLongestLate = 0.2;
  /// How long the contacts of such a scene stay where they are while a client sends none, s.
  static constexpr double kLongestKept = 1;

  /// dt: servo period, s. max_gap: longest stall of the loop that is no fault, s.
  Clocks(double dt, double max_gap) noexcept : dt_(dt), max_gap_(max_gap) {}

  double dt() const noexcept { return dt_; }
  /// Time without a tick just before this one, s.
  double gap(const Timing& timing) const noexcept {
    return static_cast<double>(timing.missed) * dt_;
  }
  /// Whether it is so long that the loop counts as broken.
  bool stalled(const Timing& timing) const noexcept { return gap(timing) > max_gap_; }

  /// From this tick on, whether somebody watches that the loop goes on.
  void watch(bool watched) noexcept { watched_ = watched; }
  bool watched() const noexcept { return watched_; }
  /// A tick, in a session or not. True if nobody has watched the session for too long.
  bool is_unguarded(bool in_session, const Timing& timing) noexcept {
    const bool counts = in_session && !watched_;
    unguarded_ = counts ? unguarded_ + static_cast<double>(1 + timing.missed) * dt_ : 0;
    return unguarded_ > kLongestUnguarded;
  }

  /// A tick, with a scene or without one. True if ticks with it take too long.
  bool is_late(bool has_scene, const Timing& timing) noexcept {
    late_ = has_scene ? std::max(0.0, late_ + timing.previous_execution - dt_) : 0;
    return late_ > kLongestLate;
  }

  /// A scene is dropped: its contacts stay for a while.
  void keep_contacts() noexcept { kept_ = kLongestKept; }
  /// A tick in which they stay, or no longer.
  void go_on_keeping(bool wanted) noexcept { kept_ = wanted ? std::max(0.0, kept_ - dt_) : 0; }
  bool keeps_contacts() const noexcept { return kept_ > 0; }
  /// A session begins.
  void begin() noexcept { kept_ = 0; }

 private:
  double dt_;
  double max_gap_;
  bool watched_ = true;
  double unguarded_ = 0;  ///< For how long in the session, s.
  double late_ = 0;       ///< Time that a scene's ticks took beyond their period, s.
  double kept_ = 0;       ///< Time for which contacts of a dropped scene are kept, s.
};

}  // namespace hlm::server
