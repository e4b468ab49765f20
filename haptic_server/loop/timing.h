// When one tick was due and when it began.
#pragma once

#include <cstdint>

namespace hlm::server {

struct Timing {
  std::uint64_t tick = 0;      ///< Periods since the loop began, missed ones included.
  double scheduled = 0;        ///< When this tick was due, s since the loop began: tick / rate.
  double begin = 0;            ///< When it began, s since the loop began; less than a period later.
  std::uint64_t missed = 0;    ///< Periods missed just before this tick.
  std::uint64_t overruns = 0;  ///< Periods missed since the loop began.
  /// How late the loop woke, s: begin minus the time for which the wake-up was set, which is that
  /// of the first missed period if there are any.
  double lateness = 0;
  double previous_execution = 0;  ///< Time of the tick before, from its beginning to its end, s.
};

}  // namespace hlm::server
