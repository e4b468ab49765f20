// What changes between ticks, for the log: sessions, silence and faults.
#pragma once

#include <cstdint>

#include "haptic_server/loop/tick_record.h"

namespace hlm::server {

/// Logs one line for each change. Not for the servo thread.
class EventLog {
 public:
  /// Every tick, in order.
  void observe(const TickRecord& record);

 private:
  ServerState state_ = ServerState::kIdle;
  DeviceHealth health_ = DeviceHealth::kGood;
  std::uint64_t session_ = 0;
  bool open_ = false;
};

}  // namespace hlm::server
