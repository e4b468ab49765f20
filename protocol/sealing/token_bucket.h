// How often something may be done.
#pragma once

#include <algorithm>
#include <optional>

namespace hlm::protocol {

class TokenBucket {
 public:
  /// `rate`: times a second in the long run; `burst`: times at once, >= 1.
  TokenBucket(double rate, double burst) noexcept : rate_(rate), burst_(burst), tokens_(burst) {}

  /// Whether it may be done now, which then counts. `now`: s, any steady origin.
  bool take(double now) noexcept {
    if (last_) tokens_ = std::min(burst_, tokens_ + rate_ * std::max(0.0, now - *last_));
    last_ = now;
    if (tokens_ < 1) return false;
    tokens_ -= 1;
    return true;
  }

 private:
  double rate_;
  double burst_;
  double tokens_;
  std::optional<double> last_;  ///< s.
};

}  // namespace hlm::protocol
