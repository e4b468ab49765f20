// A clock that jumps: sleeping lets the rest of a test's world go on in steps, in no real time.
#pragma once

#include <algorithm>
#include <functional>

#include "hlm/ve_client/run/clock.h"

namespace hlm::test {

class VirtualClock : public ve::Clock {
 public:
  /// While time passes, `pass(now)` is called every `step` seconds.
  explicit VirtualClock(std::function<void(double now)> pass, double step = 0.001)
      : pass_(std::move(pass)), step_(step) {}

  double now() override { return now_; }
  void sleep_until(double t) override {
    while (now_ < t) {
      const double next = static_cast<double>(steps_ + 1) * step_;
      now_ = std::min(t, next);
      if (now_ < next) return;
      ++steps_;
      pass_(now_);
    }
  }

 private:
  std::function<void(double)> pass_;
  double step_;
  double now_ = 0;
  long steps_ = 0;
};

}  // namespace hlm::test
