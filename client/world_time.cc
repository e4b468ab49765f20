#include "hlm/client/world_time.h"

#include <algorithm>
#include <cmath>

namespace hlm {
namespace {

/// Frames of an engine that is too slow, after which no time is made up for. A machine that stalls
/// makes one such frame.
constexpr int kSlowFrames = 2;
/// How long a frame waits for reports, periods, before it takes its usual steps without them. More
/// would be a silence to the server, less lets bodies fall where a report is late.
constexpr double kLongestWait = 2;
/// A step that lacks only this share of itself is taken, so that rounding delays none.
constexpr double kRounding = 1e-6;
constexpr double kMostSteps = 1e6;

}  // namespace

bool WorldTime::begin_frame(double now, double silence_time) noexcept {
  passed_ = begun_ ? now - begun_at_ : period_;
  // The server hears of a frame up to a period after it began.
  const bool can_make_up = passed_ <= silence_time - period_ && slow_ < kSlowFrames;
  const bool makes_up = passed_ <= period_ || can_make_up;
  owed_ = std::min(owed_ + (makes_up ? passed_ : std::min(passed_, period_)),
                   std::max(silence_time, period_));
  if (!begun_) stepped_at_ = now - period_;
  begun_at_ = now;
  begun_ = true;
  return makes_up;
}

int WorldTime::take_steps(double step, double reported) noexcept {
  const bool waits = begun_at_ - stepped_at_ <= kLongestWait * period_;
  const double due = std::min(owed_, waits ? reported : std::max(reported, period_ + step));
  const double steps = std::clamp(std::floor(due / step + kRounding), 0.0, kMostSteps);
  owed_ -= steps * step;
  if (steps > 0) stepped_at_ = begun_at_;
  return static_cast<int>(steps);
}

void WorldTime::end_steps(double now, double period) noexcept {
  slow_ = now - begun_at_ > period ? slow_ + 1 : 0;
}

}  // namespace hlm
