// Times on the wire: whole nanoseconds of the sender's own steady clock.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace hlm::protocol {

/// Seconds to the nearest nanosecond. What does not fit (292 years) stays at the end of the range.
inline std::int64_t to_nanoseconds(double seconds) noexcept {
  constexpr double kLargest = 0x1p63 - 1024;  // The largest double below 2^63.
  return static_cast<std::int64_t>(std::clamp(std::round(1e9 * seconds), -kLargest, kLargest));
}

constexpr double to_seconds(std::int64_t nanoseconds) noexcept {
  return 1e-9 * static_cast<double>(nanoseconds);
}

}  // namespace hlm::protocol
