// When the servo loop's ticks happen: at a fixed rate, by absolute wake-ups.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "hlm/common/range.h"
#include "hlm/haptic_server/loop/timing.h"

namespace hlm::server {

struct PeriodicLoopOptions {
  double rate = 1000;  ///< Hz, 100 to 8000. 512 is the paper's.
  /// The last part of each wait is spent spinning, s; 0 to half a period. Empty: default_final_spin
  /// in a thread under SCHED_FIFO, none in another. A spin brings lateness from tens of
  /// microseconds to a few at most, for its share of one processor. Longer ones run into Linux'
  /// limit on real-time threads, which stops them for 50 ms in every second.
  std::optional<double> final_spin = {};
};

inline constexpr Range kServoRates{100, 8000, "Hz"};

/// 100 µs, which covers the usual wake-up, but at most 0.4 periods: 10 % of one processor at 1 kHz,
/// 40 % from 4 kHz on. `rate`: Hz.
double default_final_spin(double rate) noexcept;

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const PeriodicLoopOptions& options);

/// An overrun skips whole periods: ticks stay on the grid of the first one and none is made up for.
class PeriodicLoop {
 public:
  /// `options` must be valid.
  explicit PeriodicLoop(const PeriodicLoopOptions& options) noexcept;

  /// Calls tick(timing) once a period until stop(). The first tick comes at once.
  template <class Tick>
  void run(Tick&& tick) noexcept {
    static_assert(std::is_nothrow_invocable_v<Tick&, const Timing&>);
    begin();
    while (!stop_.load(std::memory_order_relaxed)) {
      wait();
      tick(std::as_const(timing_));
      timing_.previous_execution = elapsed() - timing_.begin;
    }
  }

  /// Ends run() after the tick in progress or the next one. From any thread, a tick or a signal
  /// handler.
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  /// Time since run() began, s, on the steady clock.
  double elapsed() const noexcept;
  /// The final spin in use since run() began, s.
  double final_spin() const noexcept { return final_spin_; }

 private:
  void begin() noexcept;
  /// Waits for the next tick's time and fills in timing_.
  void wait() noexcept;
  void sleep_until(double time) const noexcept;

  PeriodicLoopOptions options_;
  double final_spin_ = 0;    ///< s.
  std::int64_t origin_ = 0;  ///< When run() began, ns on the steady clock.
  std::uint64_t next_ = 0;   ///< Number of the next tick, if none is missed.
  Timing timing_;
  std::atomic<bool> stop_ = false;
};

}  // namespace hlm::server
