#include "hlm/haptic_server/report/event_log.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>

#include <spdlog/spdlog.h>

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

/// What networks do to good datagrams.
bool is_usual(protocol::DropReason reason) {
  return reason == protocol::DropReason::kStale || reason == protocol::DropReason::kIncomplete;
}

}  // namespace

void EventLog::log(const TickRecord& record, spdlog::level::level_enum level,
                   std::string_view text) const {
  using Clock = spdlog::log_clock;
  const std::chrono::duration<double> age(std::max(0.0, now_() - record.time));
  spdlog::default_logger_raw()->log(Clock::now() - std::chrono::duration_cast<Clock::duration>(age),
                                    spdlog::source_loc{}, level, text);
}

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
  observe_drops(record);
  state_ = record.server;
  fade_ = record.fade;
  session_ = record.session;
  open_ = record.session_open;
}

void EventLog::observe_drops(const TickRecord& record) {
  if (record.time < next_drops_) return;
  std::string fresh;
  for (std::size_t i = 0; i < dropped_.size(); ++i) {
    const std::uint64_t count = record.dropped_for[i] - dropped_[i];
    const auto reason = static_cast<protocol::DropReason>(i);
    if (count == 0 || is_usual(reason)) continue;
    fresh += fmt::format("{}{} {} ({})", fresh.empty() ? "" : ", ", count, name_of(reason),
                         meaning_of(reason));
    dropped_[i] = record.dropped_for[i];
  }
  if (fresh.empty()) return;
  log(record, spdlog::level::warn, "dropped datagrams: " + fresh);
  next_drops_ = record.time + kDropPeriod;
}

void EventLog::observe_session(const TickRecord& record) const {
  if (open_ && !record.session_open) {
    log(record, spdlog::level::info, "the client said goodbye");
  }
  if (!record.session_open || record.session == session_) return;
  log(record, spdlog::level::info, fmt::format("session {:016x} begins", record.session));
  if (record.missing_freedoms != 0) {
    log(record, spdlog::level::warn, describe_mismatch(record.missing_freedoms));
  }
}

void EventLog::observe_scene(const TickRecord& record) {
  if (record.session != session_) scene_ = record.scene;
  if (record.scene == scene_ || record.time < next_scene_) return;
  scene_ = record.scene;
  next_scene_ = record.time + kScenePeriod;
  if (record.scene > 0) {
    log(record, spdlog::level::info,
        fmt::format("scene {}: {} placements, {} pieces", record.scene, record.placements,
                    record.pieces));
  } else if (record.session_open) {
    log(record, spdlog::level::warn,
        "no scene any more: its contacts took more time than a tick has; the client's own "
        "come in their place");
  }
}

void EventLog::observe_left_out(const TickRecord& record) {
  if (record.left_out == 0 || record.time < next_left_out_) return;
  log(record, spdlog::level::warn,
      fmt::format("so much overlaps near the tool that a tick has no time for {} pairs of pieces "
                  "or contacts: the deepest come first",
                  record.left_out));
  next_left_out_ = record.time + kLeftOutPeriod;
}

void EventLog::observe_health(const TickRecord& record) {
  if (record.health == health_ || record.time < next_health_) return;
  const bool good = record.health == DeviceHealth::kGood;
  log(record, good ? spdlog::level::info : spdlog::level::warn,
      fmt::format("the device: {}{}", meaning_of(record.health), because(record)));
  health_ = record.health;
  next_health_ = record.time + kHealthPeriod;
}

/// Updates that are refused while there is no force change no state.
void EventLog::observe_refusals(const TickRecord& record) {
  const bool waits = record.server == ServerState::kArming || record.server == ServerState::kFading;
  const bool begins = record.fade == Fade::kUpdatesInvalid && fade_ != Fade::kUpdatesInvalid;
  if (!waits || !begins || record.time < next_refusal_) return;
  log(record, spdlog::level::warn, fmt::format("no force: {}", reason_of(record)));
  next_refusal_ = record.time + kRefusalPeriod;
}

void EventLog::observe_state(const TickRecord& record) const {
  switch (record.server) {
    case ServerState::kOff:
      return log(record, spdlog::level::info,
                 fmt::format("session {:016x} is over", record.session));
    case ServerState::kArming:
      return;
    case ServerState::kRamping:
      return log(record, spdlog::level::info,
                 state_ == ServerState::kFading ? "the client is back: force rises"
                                                : "the first contacts: force rises");
    case ServerState::kActive:
      return log(record, spdlog::level::info, "force is on");
    case ServerState::kFading:
      if (record.fade == Fade::kClientLeft) return;
      return log(record, spdlog::level::warn,
                 fmt::format("force fades to zero: {}", reason_of(record)));
    case ServerState::kFault:
      return log(
          record, spdlog::level::err,
          fmt::format(
              "fault: {}{}; {}. Force is off until {}a person asks for a new session: restart "
              "ve_client, or press Reset on its page if that shows this tool",
              meaning_of(record.fault), because(record), remedy_of(record.fault),
              ends_at_device(record.fault) ? "haptic_doctor clear is said on this machine, and "
                                           : ""));
  }
}

}  // namespace hlm::server
