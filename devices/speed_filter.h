// The speed of a handle whose device gives none: its change of pose through a low-pass.
#pragma once

#include <cmath>
#include <limits>

#include "hlm/common/spatial.h"

namespace hlm::server {

/// Change of pose through a low-pass of first order whose time constant is `lag`, s.
class SpeedFilter {
 public:
  /// The twist at X, which was read at `time`, s. What was not looked at for long begins anew.
  Twist filtered(const Pose& X, double time, double lag) noexcept {
    const double dt = time - time_;
    const bool goes_on = dt > 0 && dt < kLongestStep && V_.allFinite();
    if (goes_on) {
      const double gain = lag > 0 ? -std::expm1(-dt / lag) : 1;
      V_ += gain * (displacement(X_, X) / dt - V_);
    } else if (!(dt == 0)) {
      V_.setZero();
    }
    X_ = X;
    time_ = time;
    return V_;
  }
  void begin() noexcept { time_ = -std::numeric_limits<double>::infinity(); }

 private:
  /// A speed is not that of a longer time, s.
  static constexpr double kLongestStep = 0.1;

  double time_ = -std::numeric_limits<double>::infinity();
  Pose X_;
  Twist V_ = Twist::Zero();
};

}  // namespace hlm::server
