#include "hlm/haptic_server/report/event_log.h"

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// What the device itself says, as the end of a sentence.
std::string because(const TickRecord& record) {
  return *record.cause != '\0' ? std::string(": ") + record.cause : "";
}

/// Why force fades, and what to do.
std::string reason_of(const TickRecord& record) {
  if (record.fade == Fade::kUpdatesInvalid && !record.refusal.empty()) {
    return fmt::format("every update of the client is refused: {}", record.refusal);
  }
  return fmt::format("{}; {}", meaning_of(record.fade), remedy_of(record.fade));
}

}  // namespace

void EventLog::observe(const TickRecord& record) {
  observe_session(record);
  observe_scene(record);
  const bool fails_again = record.server == ServerState::kFault && record.session != session_;
  if (record.server != state_ || fails_again) {
    observe_state(record);
  } else {
    observe_refusals(record);
  }
  if (renders_force(record.server)) observe_health(record);
  observe_left_out(record);
  state_ = record.server;
  fade_ = record.fade;
  session_ = record.session;
  open_ = record.session_open;
}

void EventLog::observe_session(const TickRecord& record) const {
  if (open_ && !record.session_open) {
    log_event(now_, record, spdlog::level::info, "the client said goodbye");
  }
  if (!record.session_open || record.session == session_) return;
  log_event(now_, record, spdlog::level::info,
            fmt::format("session {:016x} begins", record.session));
  if (record.missing_freedoms != 0) {
    log_event(now_, record, spdlog::level::warn, describe_mismatch(record.missing_freedoms));
  }
}

void EventLog::observe_scene(const TickRecord& record) {
  if (record.session != session_) scene_ = record.scene;
  if (record.scene == scene_ || record.time < next_scene_) return;
  scene_ = record.scene;
  next_scene_ = record.time + kScenePeriod;
  if (record.scene > 0) {
    log_event(now_, record, spdlog::level::info,
              fmt::format("scene {}: {} placements, {} pieces", record.scene, record.placements,
                          record.pieces));
  } else if (record.session_open) {
    log_event(now_, record, spdlog::level::warn,
              "no scene any more: its contacts took more time than a tick has; the client's own "
              "come in their place");
  }
}

void EventLog::observe_left_out(const TickRecord& record) {
  if (record.left_out == 0 || record.time < next_left_out_) return;
  log_event(
      now_, record, spdlog::level::warn,
      fmt::format("so much overlaps near the tool that a tick has no time for {} pairs of pieces "
                  "or contacts: the deepest come first",
                  record.left_out));
  next_left_out_ = record.time + kLeftOutPeriod;
}

void EventLog::observe_health(const TickRecord& record) {
  if (record.health == health_ || record.time < next_health_) return;
  const bool good = record.health == DeviceHealth::kGood;
  log_event(now_, record, good ? spdlog::level::info : spdlog::level::warn,
            fmt::format("the device: {}{}", meaning_of(record.health), because(record)));
  health_ = record.health;
  next_health_ = record.time + kHealthPeriod;
}

/// Updates that are refused while there is no force change no state.
void EventLog::observe_refusals(const TickRecord& record) {
  const bool waits = record.server == ServerState::kArming || record.server == ServerState::kFading;
  const bool begins = record.fade == Fade::kUpdatesInvalid && fade_ != Fade::kUpdatesInvalid;
  if (!waits || !begins || record.time < next_refusal_) return;
  log_event(now_, record, spdlog::level::warn, fmt::format("no force: {}", reason_of(record)));
  next_refusal_ = record.time + kRefusalPeriod;
}

void EventLog::observe_state(const TickRecord& record) const {
  switch (record.server) {
    case ServerState::kOff:
      return log_event(now_, record, spdlog::level::info,
                       fmt::format("session {:016x} is over", record.session));
    case ServerState::kArming:
      return;
    case ServerState::kRamping:
      return log_event(now_, record, spdlog::level::info,
                       state_ == ServerState::kFading ? "the client is back: force rises"
                                                      : "the first contacts: force rises");
    case ServerState::kActive:
      return log_event(now_, record, spdlog::level::info, "force is on");
    case ServerState::kFading:
      if (record.fade == Fade::kClientLeft) return;
      return log_event(now_, record, spdlog::level::warn,
                       fmt::format("force fades to zero: {}", reason_of(record)));
    case ServerState::kFault:
      return log_event(
          now_, record, spdlog::level::err,
          fmt::format(
              "fault: {}{}; {}. Force is off until {}a person asks for a new session: restart "
              "ve_client, or press Reset on its page if that shows this tool",
              meaning_of(record.fault), because(record), remedy_of(record.fault),
              ends_at_device(record.fault) ? "haptic_doctor clear is said on this machine, and "
                                           : ""));
  }
}

}  // namespace hlm::server
