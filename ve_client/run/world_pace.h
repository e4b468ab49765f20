// How fast the world's time goes beside the hand's.
#pragma once

#include <algorithm>

namespace hlm::ve {

/// The hand's time is real. In the world's, which may be slow or stand still, nothing is different;
/// the hand meets what is in it as a slow world looks from outside: velocities times the pace,
/// mobilities and accelerations times its square. So a weight weighs the same, and what stands
/// still has no velocity and cannot be moved.
class WorldPace {
 public:
  /// Least that is no pause. Slower, and the tool, which is not slow, is too fast for the engine.
  static constexpr double kLeast = 0.1;
  /// Time in which the pace changes by 1, s. Less makes moving things hit the hand as they stop.
  static constexpr double kChange = 0.25;

  /// A frame of `period` seconds of the hand begins; `wanted`: the pace to come to, in [0, 1], less
  /// than kLeast being 0. Returns how far the world goes on, s; 0: it stands still.
  double begin_frame(double period, double wanted) noexcept {
    const double goal = wanted < kLeast ? 0 : wanted;
    const double change = period / kChange;
    now_ = std::clamp(goal, now_ - change, now_ + change);
    if (now_ < kLeast) now_ = goal == 0 ? 0 : kLeast;
    double length = now_ * period;
    if (now_ == 0 && steps_ > 0) {
      --steps_;
      length = period;
    }
    time_ += length;
    return length;
  }
  /// In a pause, and only then, the world goes on by one frame, and stands still again.
  void step() noexcept {
    if (now_ == 0) ++steps_;
  }

  /// The present pace, 0 to 1; 0 also in a single step.
  double now() const noexcept { return now_; }
  /// Of the tool in the engine, which is never slow: that of the frame's step, 1 where there is
  /// none.
  double of_step() const noexcept { return now_ > 0 ? now_ : 1; }
  /// The world's time, s.
  double time() const noexcept { return time_; }

 private:
  double now_ = 1;
  int steps_ = 0;  ///< That are yet to be taken.
  double time_ = 0;
};

}  // namespace hlm::ve
