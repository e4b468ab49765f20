// What the servo is started with, and what of it a control can change.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "hlm/common/range.h"
#include "hlm/common/tuning.h"
#include "hlm/haptic_server/control/controller.h"
#include "hlm/haptic_server/local_model/parameters.h"
#include "hlm/haptic_server/safety/handle_limits.h"
#include "hlm/haptic_server/safety/limiter.h"

namespace hlm::server {

struct ServoOptions {
  double rate = 1000;  ///< Hz.
  LocalModelParameters local_model;
  ControllerKind controller = ControllerKind::kFourChannel;
  ControllerGains gains;
  LimiterOptions limits;
  HandleLimits handle;
  /// Silence of the client after which force fades to zero, s; unset: default_silence_time(), or
  /// kOldestPoses where the server moves what the hand holds.
  /// Shorter than a hiccup of the simulator and force comes and goes; longer and it outlives a dead
  /// client.
  std::optional<double> silence_time;
  /// Longest gap between two ticks before the loop counts as broken, s.
  double max_gap = 0.25;
  /// Keeps stiffness that the device does not support, which may make it shake.
  bool keep_stiffness = false;
};

inline constexpr Range kSilenceTimes{0.01, 10, "s"};
inline constexpr Range kDefaultSilenceTimes{0.05, 0.25, "s"};

/// The silence, s, in which a client whose updates are `period` s apart counts as gone: 4.5
/// periods, within kDefaultSilenceTimes. At 60 Hz force is gone 95 ms after the last word, and
/// three lost updates in a row are endured: at 5 % loss four come once in 45 minutes.
double default_silence_time(double period) noexcept;

inline constexpr std::array<NumberOf<ServoOptions>, 1> kServoNumbers{{
    {{1e-3, 60, "s"},
     "max gap",
     &ServoOptions::max_gap,
     "A longer gap between two ticks is a fault"},
}};

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const ServoOptions& options);

/// The part of the options that a control can change.
Tuning tuning_of(const ServoOptions& options) noexcept;

/// The options with that part changed. Static friction follows kinetic friction where this changes;
/// otherwise it stays, and so does the difference between the two.
ServoOptions tuned(ServoOptions options, const Tuning& tuning) noexcept;

}  // namespace hlm::server
