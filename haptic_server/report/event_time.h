// Lines of the log with the time of what they tell, which is that of a tick and not of the writing.
#pragma once

#include <functional>
#include <string_view>

#include <spdlog/common.h>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// The time since the server started, s, as in TickRecord::time.
using ServerClock = std::function<double()>;

/// Logs a line with the wall time of the record's tick.
void log_event(const ServerClock& now, const TickRecord& record, spdlog::level::level_enum level,
               std::string_view text);

}  // namespace hlm::server
