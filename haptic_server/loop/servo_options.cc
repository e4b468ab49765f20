#include "hlm/haptic_server/loop/servo_options.h"

#include <algorithm>

namespace hlm::server {

std::optional<std::string> find_error(const ServoOptions& options) {
  if (auto error = find_error(options.local_model)) return error;
  if (auto error = find_error(options.gains)) return error;
  if (auto error = find_error(options.limits, kLimiterNumbers)) return error;
  if (auto error = find_error(options.handle, kHandleNumbers)) return error;
  if (options.silence_time) {
    if (auto error = find_error("silence time", *options.silence_time, kSilenceTimes)) return error;
  }
  return find_error(options, kServoNumbers);
}

double default_silence_time(double period) noexcept {
  constexpr double kPeriods = 4.5;
  return std::clamp(kPeriods * period, kDefaultSilenceTimes.least, kDefaultSilenceTimes.most);
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
  // What a newer client asks for and this server does not know stays as it is.
  if (is_known(tuning.update_rule)) local.update_rule = tuning.update_rule;
  local.stiffness = tuning.stiffness;
  local.damping = tuning.damping;
  if (tuning.friction != local.kinetic_friction) {
    local.static_friction = local.kinetic_friction = tuning.friction;
  }
  local.restitution = tuning.restitution;
  if (is_known(tuning.controller)) options.controller = tuning.controller;
  options.gains = {.stiffness = tuning.coupling_stiffness,
                   .damping = tuning.coupling_damping,
                   .angular_stiffness = tuning.coupling_angular_stiffness,
                   .angular_damping = tuning.coupling_angular_damping};
  return options;
}

}  // namespace hlm::server
