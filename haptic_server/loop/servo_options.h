// What the servo is started with, and what of it a control can change.
#pragma once

#include <optional>
#include <string>

#include "common/tuning.h"
#include "haptic_server/control/controller.h"
#include "haptic_server/control/limiter.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

struct ServoOptions {
  double rate = 1000;  ///< Hz.
  LocalModelParameters local_model;
  ControllerKind controller = ControllerKind::kFourChannel;
  ControllerGains gains;
  LimiterOptions limits;
  /// Silence of the client after which force fades to zero, s. Shorter than a hiccup of the
  /// simulator and force comes and goes; longer and it outlives a dead client.
  double silence_time = 0.25;
  /// Longest gap between two ticks before the loop counts as broken, s.
  double max_gap = 0.25;
};

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const ServoOptions& options);

/// The part of the options that a control can change.
Tuning tuning_of(const ServoOptions& options) noexcept;

/// The options with that part changed. Static friction follows kinetic friction where this changes;
/// otherwise it stays, and so does the difference between the two.
ServoOptions tuned(ServoOptions options, const Tuning& tuning) noexcept;

}  // namespace hlm::server
