// How much force there is: one budget for all that commands the device.
#pragma once

#include <algorithm>

#include "haptic_server/device/device.h"

namespace hlm::server {

/// The smaller of what the user allows and what the device is rated for.
struct ForceBudget {
  double max_force = 0;        ///< N.
  double max_torque = 0;       ///< N·m.
  double max_force_step = 0;   ///< Change per servo period, N.
  double max_torque_step = 0;  ///< Change per servo period, N·m.

  /// max_force: N; max_torque: N·m; dt: servo period, s.
  static ForceBudget of(double max_force, double max_torque, const DeviceRatings& device,
                        double dt) noexcept {
    return {std::min(max_force, device.max_force), std::min(max_torque, device.max_torque),
            device.max_force_rate * dt, device.max_torque_rate * dt};
  }
};

}  // namespace hlm::server
