// How much force there is: one budget for all that commands the device.
#pragma once

#include <algorithm>
#include <cmath>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/haptic_server/safety/limiter_options.h"

namespace hlm::server {

/// The smaller of what the user allows at the handle and what the device is rated for in the world.
/// What a device does not rate follows from its force and its torque, so that the defaults limit a
/// weak one, too.
struct ForceBudget {
  /// Time in which an unrated device takes its whole force, s.
  static constexpr double kWholeForceTime = 4e-3;
  /// Speeds at which it gives its whole force and torque, m/s and rad/s.
  static constexpr double kWholeForceSpeed = 1.25;
  static constexpr double kWholeTorqueRate = 5;
  /// Way over which it gives its whole force beyond what is explained, m.
  static constexpr double kWholeForceWay = 0.042;
  /// Way and speed of what the client claims, m and m/s.
  static constexpr double kClaimedWay = 0.17;
  static constexpr double kClaimedSpeed = 0.085;

  /// Time constant in which motors warm up and cool, s. Less cuts a long push that they bear; more
  /// lets them get hot, and the device then ends the session.
  static constexpr double kWarmingTime = 60;

  double max_force = 0;         ///< N.
  double continuous_force = 0;  ///< What the motors bear for ever, N.
  double max_torque = 0;        ///< Torque in the world, N·m.
  double max_force_step = 0;    ///< Change per servo period, N.
  double max_torque_step = 0;   ///< Change per servo period, in the world, N·m.

  double max_power = 0;          ///< Power of the force, given to the hand at the handle, W.
  double max_turning_power = 0;  ///< Power of the torque, W.
  EnergyLimits energy;           ///< At the handle.

  /// dt: servo period, s.
  static ForceBudget of(const LimiterOptions& allowed, const DeviceRatings& device,
                        double dt) noexcept {
    const auto least = [](double allows, double rating, double otherwise) {
      return std::min(allows, std::isfinite(rating) ? rating : otherwise);
    };
    const double force = device.max_force;
    const double torque = device.max_torque;
    const double of_handle = device.torque_scale();
    return {std::min(allowed.max_force, force),
            std::min(force, device.continuous_force),
            std::min(allowed.max_torque * of_handle, torque),
            least(allowed.max_force_rate, device.max_force_rate, force / kWholeForceTime) * dt,
            least(allowed.max_torque_rate * of_handle, device.max_torque_rate,
                  torque / kWholeForceTime) *
                dt,
            least(allowed.max_power, device.max_power, force * kWholeForceSpeed),
            least(allowed.max_turning_power, device.max_turning_power,
                  torque / of_handle * kWholeTorqueRate),
            {.capacity = std::min(allowed.max_energy, force * kWholeForceWay),
             .claim = std::min(allowed.claim_energy, force * kClaimedWay),
             .claim_power = std::min(allowed.claim_power, force * kClaimedSpeed)}};
  }
};

}  // namespace hlm::server
