#include "hlm/haptic_server/report/event_time.h"

#include <algorithm>
#include <chrono>

#include <spdlog/spdlog.h>

namespace hlm::server {

void log_event(const ServerClock& now, const TickRecord& record, spdlog::level::level_enum level,
               std::string_view text) {
  using Clock = spdlog::log_clock;
  const std::chrono::duration<double> age(std::max(0.0, now() - record.time));
  spdlog::default_logger_raw()->log(Clock::now() - std::chrono::duration_cast<Clock::duration>(age),
                                    spdlog::source_loc{}, level, text);
}

}  // namespace hlm::server
