// What a driver knows of a model before it is opened: one row of the driver's table.
#pragma once

#include <cmath>
#include <numbers>
#include <span>
#include <string_view>

#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// Values of the vendor's documents; where these are silent, usual ones of such devices, rated low.
/// 0 is unknown, except where it says otherwise.
struct DeviceModel {
  /// Part of the name that the device or its library gives; empty: of all that no row before names.
  std::string_view name;
  double force = 0;              ///< Largest force, N.
  double continuous_force = 0;   ///< Force that the motors bear for ever, N; 0: the largest.
  double torque = 0;             ///< Largest torque, N·m; 0: it takes none.
  double stiffness = 0;          ///< Renderable at 1 kHz, N/m.
  double angular_stiffness = 0;  ///< N·m/rad.
  double mass = 0;               ///< Apparent mass at the handle, kg.
  double delay = 0;              ///< From a command to its effect and from a pose to its report, s.
  double step = 0;               ///< Encoder step at the handle, m.
  double angle_step = 0;         ///< Encoder step of its orientation, rad.
  /// Cut-off of the low-pass that makes its speed of its poses, Hz; 0: its vendor's own speed. Less
  /// lags, and walls become soft; more lets encoder steps through, and the damping becomes small.
  double cutoff = 0;
  double gripper_range = 0;   ///< Angle between closed and open, rad; 0: it has no gripper.
  double gripper_force = 0;   ///< Largest force of the gripper, N; 0: it takes none.
  double gripper_travel = 0;  ///< Way of its finger in that range, m.
};

/// The first row whose name is a part of `name`; the last row of a table has an empty name.
inline const DeviceModel& model_of(std::span<const DeviceModel> table,
                                   std::string_view name) noexcept {
  for (const DeviceModel& row : table) {
    if (name.find(row.name) != std::string_view::npos) return row;
  }
  return table.back();
}

/// What the row rates, without what a driver's own speed and exchange decide.
inline DeviceRatings ratings_of(const DeviceModel& row) noexcept {
  DeviceRatings ratings;
  ratings.max_force = row.force;
  if (row.continuous_force > 0) ratings.continuous_force = row.continuous_force;
  ratings.max_torque = row.torque;
  if (row.stiffness > 0) ratings.max_stiffness = row.stiffness;
  if (row.angular_stiffness > 0) ratings.max_angular_stiffness = row.angular_stiffness;
  ratings.mass = row.mass;
  ratings.delay = row.delay;
  ratings.position_step = row.step;
  ratings.gripper = row.gripper_range > 0;
  ratings.max_gripper_force = row.gripper_force;
  ratings.gripper_travel = row.gripper_travel;
  return ratings;
}

/// The speed's lag and steps behind such a low-pass, with poses every `period` seconds.
inline void rate_speed(const DeviceModel& row, double cutoff, double period,
                       DeviceRatings& ratings) noexcept {
  ratings.velocity_lag = 1 / (2 * std::numbers::pi * cutoff);
  const double portion = -std::expm1(-period / ratings.velocity_lag) / period;
  ratings.speed_step = row.step * portion;
  ratings.turn_step = row.angle_step * portion;
}

/// A row, and what its device is rated for with the driver's keys as they are.
struct RatedModel {
  DeviceModel model;
  DeviceRatings ratings;
};

}  // namespace hlm::server
