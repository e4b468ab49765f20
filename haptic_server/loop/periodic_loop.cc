#include "hlm/haptic_server/loop/periodic_loop.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>

#include <sched.h>

namespace hlm::server {
namespace {

constexpr double kMaxSpinShare = 0.5;            // Share of a period.
constexpr std::int64_t kSecond = 1'000'000'000;  // ns.

std::int64_t steady_now() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

bool runs_under_fifo() noexcept {
  return (sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO;
}

}  // namespace

std::optional<std::string> find_error(const PeriodicLoopOptions& options) {
  if (auto error = find_error("rate", options.rate, kServoRates)) return error;
  const Range spins{0, kMaxSpinShare / options.rate, "s"};
  auto error = find_error("final spin", options.final_spin.value_or(0), spins);
  if (error) *error += ", half a period";
  return error;
}

double default_final_spin(double rate) noexcept {
  constexpr double kUsualSpin = 100e-6;  // s.
  constexpr double kLargestShare = 0.4;
  return std::min(kUsualSpin, kLargestShare / rate);
}

PeriodicLoop::PeriodicLoop(const PeriodicLoopOptions& options) noexcept : options_(options) {}

double PeriodicLoop::elapsed() const noexcept {
  return 1e-9 * static_cast<double>(steady_now() - origin_);
}

void PeriodicLoop::begin() noexcept {
  final_spin_ =
      options_.final_spin.value_or(runs_under_fifo() ? default_final_spin(options_.rate) : 0);
  origin_ = steady_now();
  next_ = 0;
  timing_ = Timing{};
}

void PeriodicLoop::wait() noexcept {
  const double due = static_cast<double>(next_) / options_.rate;
  sleep_until(due - final_spin_);
  double now = elapsed();
  while (now < due) now = elapsed();

  const auto newest = static_cast<std::uint64_t>(now * options_.rate);
  timing_.tick = std::max(next_, newest);
  timing_.scheduled = static_cast<double>(timing_.tick) / options_.rate;
  timing_.begin = std::max(now, timing_.scheduled);
  timing_.missed = timing_.tick - next_;
  timing_.overruns += timing_.missed;
  timing_.lateness = now - due;
  next_ = timing_.tick + 1;
}

void PeriodicLoop::sleep_until(double time) const noexcept {
  if (time <= 0) return;
  const std::int64_t wake = origin_ + std::llround(1e9 * time);
  const timespec until{.tv_sec = wake / kSecond, .tv_nsec = wake % kSecond};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace hlm::server
