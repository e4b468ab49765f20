// Datagrams that were dropped, for the log.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "hlm/haptic_server/report/event_time.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// Logs how many were dropped for which reason, at most once a second: a flood must not fill the
/// disk. Not what is stale or incomplete: every network does that. Not for the servo thread.
class DropLog {
 public:
  explicit DropLog(ServerClock now) : now_(std::move(now)) {}
  /// Every tick, in order.
  void observe(const TickRecord& record);

 private:
  ServerClock now_;
  std::array<std::uint64_t, protocol::kDropReasons> logged_{};
  double next_ = 0;  ///< s.
};

}  // namespace hlm::server
