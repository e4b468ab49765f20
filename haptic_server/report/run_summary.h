// What a run was like, in a few lines at its end.
#pragma once

#include <cstdint>
#include <string>

#include "hlm/haptic_server/report/drift.h"
#include "hlm/haptic_server/report/histogram.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// Gathers all ticks of a run.
class RunSummary {
 public:
  /// Every tick, in order.
  void observe(const TickRecord& record) noexcept;
  /// Several lines, each with its end; the rate is that of the ticks observed. lost: ticks that
  /// were not recorded.
  std::string text(std::uint64_t lost) const;

 private:
  Histogram lateness_;
  Histogram execution_;
  double first_time_ = 0;  ///< s.
  TickRecord last_;
  std::uint64_t updates_ = 0;
  double peak_force_ = 0;  ///< N.
  DriftRecord device_proxy_;
  DriftRecord proxy_tool_;
};

}  // namespace hlm::server
