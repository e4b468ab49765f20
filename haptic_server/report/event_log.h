// What changes between ticks, for the log: sessions, the states of the force, faults, drops.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>

#include <spdlog/common.h>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// The time since the server started, s, as in TickRecord::time.
using ServerClock = std::function<double()>;

/// Logs one line for each change, with the time of its tick. Not for the servo thread.
class EventLog {
 public:
  explicit EventLog(ServerClock now) : now_(std::move(now)) {}
  /// Every tick, in order.
  void observe(const TickRecord& record);

 private:
  void observe_session(const TickRecord& record) const;
  void observe_scene(const TickRecord& record);
  void observe_state(const TickRecord& record) const;
  void observe_health(const TickRecord& record);
  void observe_refusals(const TickRecord& record);
  void observe_left_out(const TickRecord& record);
  void observe_drops(const TickRecord& record);
  /// With the wall time of the record's tick.
  void log(const TickRecord& record, spdlog::level::level_enum level, std::string_view text) const;

  /// Between two lines on the device's health, s: it can change with every tick, and a reader that
  /// is slow to take the lines would stop the log.
  static constexpr double kHealthPeriod = 1;
  /// The same for lines on refused updates.
  static constexpr double kRefusalPeriod = 1;
  /// And for lines on what a tick has not the time for.
  static constexpr double kLeftOutPeriod = 10;

  /// The same for lines on scenes, of which a client may commit one in each of its steps.
  static constexpr double kScenePeriod = 1;
  /// And for lines on drops: a flood must not fill the disk.
  static constexpr double kDropPeriod = 1;

  ServerClock now_;
  ServerState state_ = ServerState::kOff;
  DeviceHealth health_ = DeviceHealth::kGood;
  Fade fade_ = Fade::kNone;
  double next_refusal_ = 0;   ///< s.
  double next_left_out_ = 0;  ///< s.
  double next_health_ = 0;    ///< When a line on it may come, s.
  std::uint64_t session_ = 0;
  double next_scene_ = 0;    ///< s.
  double next_drops_ = 0;    ///< s.
  std::uint32_t scene_ = 0;  ///< The latest that has a line.
  bool open_ = false;
  std::array<std::uint64_t, protocol::kDropReasons> dropped_{};  ///< That have a line.
};

}  // namespace hlm::server
