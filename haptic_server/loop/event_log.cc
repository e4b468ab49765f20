#include "haptic_server/loop/event_log.h"

#include <spdlog/spdlog.h>

namespace hlm::server {
void EventLog::observe(const TickRecord& record) {
  const bool changes = record.server != state_;
  if (open_ && !record.session_open) spdlog::info("the client said goodbye");
  if (record.session_open && record.session != session_) {
    spdlog::info("session {:016x} begins", record.session);
    if (record.missing_freedoms != 0)
      spdlog::warn("{}", describe_mismatch(record.missing_freedoms));
  } else if (changes && record.server == ServerState::kRunning) {
    spdlog::info("the client is back");
  } else if (changes && record.server == ServerState::kSilent && record.session_open) {
    spdlog::warn("the client is silent: force fades to zero");
  } else if (changes && record.server == ServerState::kIdle) {
    spdlog::info("session {:016x} is over", record.session);
  }
  if (changes && record.server == ServerState::kFault) {
    spdlog::error(
        "fault: {}; force is off until a person asks for a new session: restart ve_client, or "
        "press Reset on its page",
        meaning_of(record.fault));
  }
  if (record.health != health_ && record.server == ServerState::kRunning) {
    const bool good = record.health == DeviceHealth::kGood;
    spdlog::log(good ? spdlog::level::info : spdlog::level::warn, "the device: {}",
                meaning_of(record.health));
    health_ = record.health;
  }
  state_ = record.server;
  session_ = record.session;
  open_ = record.session_open;
}

}  // namespace hlm::server
