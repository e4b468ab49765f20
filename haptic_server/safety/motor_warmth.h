// How warm a device's motors get, by what they were commanded: an I²t limit.
#pragma once

#include <algorithm>
#include <cmath>

namespace hlm::server {

/// A motor's heat is the square of its force through a low-pass. It may reach that of the force
/// which it bears for ever; from there on no more than that is allowed, until it is cool again.
class MotorWarmth {
 public:
  /// peak, continuous: N; time: time constant of the low-pass, s. Nothing is limited where the
  /// motors bear their peak for ever.
  MotorWarmth(double peak, double continuous, double time) noexcept
      : peak_(peak), continuous_(std::min(continuous, peak)), time_(time) {}

  /// A step of dt, s, with that force, N. says_warm: the device says so itself.
  void pass(double force, bool says_warm, double dt) noexcept {
    if (!(continuous_ < peak_)) return;
    const double portion = -std::expm1(-dt / time_);
    heat_ += portion * (force * force - heat_);
    const double full = continuous_ * continuous_;
    if (says_warm || heat_ >= full) cools_ = true;
    if (!says_warm && heat_ < kCool * full) cools_ = false;
    const double step = (peak_ - continuous_) * dt / kChange;
    allowed_ = std::clamp(allowed_ + (cools_ ? -step : step), continuous_, peak_);
  }

  /// Largest force, N.
  double allowed() const noexcept { return continuous_ < peak_ ? allowed_ : peak_; }
  bool cools() const noexcept { return cools_; }

 private:
  /// Share of the heat below which the peak is allowed again. More lets the force come and go
  /// sooner; less holds it down for longer.
  static constexpr double kCool = 0.7;
  /// Time in which the limit goes from the peak to the continuous force and back, s: a hand follows
  /// it. Less is felt as a wall that gives way.
  static constexpr double kChange = 1;

  double peak_;
  double continuous_;
  double time_;
  double allowed_ = peak_;
  double heat_ = 0;  ///< N².
  bool cools_ = false;
};

}  // namespace hlm::server
