#include "haptic_server/loop/servo_options.h"

#include <algorithm>
#include <cmath>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// A welcome could not report options outside the ranges of a control, nor a control set them back.
std::optional<std::string> find_error(const Tuning& tuning) {
  for (const TuningRange& range : kTuningRanges) {
    const double value = tuning.*range.number;
    if (value >= range.least && value <= range.most) continue;
    std::string name = range.name;
    std::replace(name.begin(), name.end(), '_', ' ');
    return fmt::format("{} {} must be {} to {}{}{}", name, value, range.least, range.most,
                       *range.unit ? " " : "", range.unit);
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> find_error(const ServoOptions& options) {
  if (auto error = find_error(tuning_of(options))) return error;
  if (auto error = find_error(options.local_model)) return error;
  if (auto error = find_error(options.gains)) return error;
  const auto check = [](const char* name, double value,
                        const char* unit) -> std::optional<std::string> {
    if (value > 0 && std::isfinite(value)) return std::nullopt;
    return fmt::format("{} {} must be finite and > 0 {}", name, value, unit);
  };
  if (auto error = check("force limit", options.limits.max_force, "N")) return error;
  if (auto error = check("torque limit", options.limits.max_torque, "N·m")) return error;
  if (auto error = check("fade time", options.limits.fade_time, "s")) return error;
  if (auto error = check("silence time", options.silence_time, "s")) return error;
  return check("largest gap", options.max_gap, "s");
}

Tuning tuning_of(const ServoOptions& options) noexcept {
  const LocalModelParameters& local = options.local_model;
  const ControllerGains& gains = options.gains;
  return {.update_rule = local.update_rule,
          .controller = options.controller,
          .stiffness = local.stiffness,
          .damping = local.damping,
          .friction = local.kinetic_friction,
          .restitution = local.restitution,
          .coupling_stiffness = gains.stiffness,
          .coupling_damping = gains.damping,
          .coupling_angular_stiffness = gains.angular_stiffness,
          .coupling_angular_damping = gains.angular_damping};
}

ServoOptions tuned(ServoOptions options, const Tuning& tuning) noexcept {
  LocalModelParameters& local = options.local_model;
  local.update_rule = tuning.update_rule;
  local.stiffness = tuning.stiffness;
  local.damping = tuning.damping;
  if (tuning.friction != local.kinetic_friction) {
    local.static_friction = local.kinetic_friction = tuning.friction;
  }
  local.restitution = tuning.restitution;
  options.controller = tuning.controller;
  options.gains = {.stiffness = tuning.coupling_stiffness,
                   .damping = tuning.coupling_damping,
                   .angular_stiffness = tuning.coupling_angular_stiffness,
                   .angular_damping = tuning.coupling_angular_damping};
  return options;
}

}  // namespace hlm::server
