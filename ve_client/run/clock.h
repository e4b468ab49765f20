// The time by which frames are paced: the system's, or a virtual one.
#pragma once

#include <cmath>
#include <ctime>

namespace hlm::ve {

class Clock {
 public:
  virtual ~Clock() = default;

  /// Steady time, s, any origin.
  virtual double now() = 0;
  /// Returns at time t (s) or, where that has passed, at once.
  virtual void sleep_until(double t) = 0;
};

/// The system's steady clock, since it was made. A signal ends its sleep early.
class SteadyClock : public Clock {
 public:
  SteadyClock() { clock_gettime(CLOCK_MONOTONIC, &origin_); }

  double now() override {
    timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return static_cast<double>(time.tv_sec - origin_.tv_sec) +
           1e-9 * static_cast<double>(time.tv_nsec - origin_.tv_nsec);
  }

  void sleep_until(double t) override {
    const double seconds = std::floor(t);
    timespec time = origin_;
    time.tv_sec += static_cast<time_t>(seconds);
    time.tv_nsec += static_cast<long>(1e9 * (t - seconds));
    constexpr long kSecond = 1'000'000'000;
    if (time.tv_nsec >= kSecond) {
      time.tv_nsec -= kSecond;
      ++time.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr);
  }

 private:
  timespec origin_{};
};

}  // namespace hlm::ve
