// Datagrams that were refused because of their seal, for the log.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "hlm/loop/event_time.h"
#include "hlm/loop/tick_record.h"

namespace hlm::server {

/// Logs what was refused and why, at most once a second: a flood must not fill the disk. Not for
/// the servo thread.
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
