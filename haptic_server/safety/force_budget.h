// How much force there is: one budget for all that commands the device.
#pragma once

#include <algorithm>

#include "haptic_server/device/device.h"
#include "haptic_server/safety/limiter_options.h"

namespace hlm::server {

/// The smaller of what the user allows and what the device is rated for.
struct ForceBudget {
  double max_force = 0;        ///< N.
  double max_torque = 0;       ///< N·m.
  double max_force_step = 0;   ///< Change per servo period, N.
  double max_torque_step = 0;  ///< Change per servo period, N·m.

  double max_power = 0;          ///< Of the force, given to the hand, W.
  double max_turning_power = 0;  ///< Of the torque, W.

  /// dt: servo period, s.
  static ForceBudget of(const LimiterOptions& allowed, const DeviceRatings& device,
                        double dt) noexcept {
    return {std::min(allowed.max_force, device.max_force),
            std::min(allowed.max_torque, device.max_torque),
            std::min(allowed.max_force_rate, device.max_force_rate) * dt,
            std::min(allowed.max_torque_rate, device.max_torque_rate) * dt,
            std::min(allowed.max_power, device.max_power),
            std::min(allowed.max_turning_power, device.max_turning_power)};
  }
};

}  // namespace hlm::server
