// What the server asks of a haptic device.
#pragma once

#include <limits>
#include <optional>

#include "common/spatial.h"

namespace hlm::server {

/// What a device can do. A value that a device does not rate is infinite.
struct DeviceRatings {
  double max_force = std::numeric_limits<double>::infinity();              ///< N.
  double max_torque = std::numeric_limits<double>::infinity();             ///< N·m.
  double max_force_rate = std::numeric_limits<double>::infinity();         ///< N/s.
  double max_torque_rate = std::numeric_limits<double>::infinity();        ///< N·m/s.
  double max_stiffness = std::numeric_limits<double>::infinity();          ///< Renderable, N/m.
  double max_angular_stiffness = std::numeric_limits<double>::infinity();  ///< N·m/rad.
  double mass = 0;     ///< Apparent mass at the handle, kg; 0 if unknown.
  double inertia = 0;  ///< Apparent inertia at the handle, kg·m²; 0 if unknown.
  double damping = 0;  ///< Physical damping at the handle, N·s/m.
};

struct DeviceState {
  Pose X_WD;                   ///< Handle in the world.
  Twist V_WD = Twist::Zero();  ///< Its twist, world axes.
  /// The hand's wrench on the handle, world axes, about the handle's origin; empty where the device
  /// has no such sensor.
  std::optional<Wrench> F_hand;
};

/// One haptic device. All calls come from the servo thread: none waits beyond the device's own
/// exchange, allocates or throws.
class Device {
 public:
  virtual ~Device() = default;

  virtual const DeviceRatings& ratings() const noexcept = 0;
  /// Whether DeviceState::F_hand will be filled.
  virtual bool measures_hand_wrench() const noexcept = 0;
  /// From here on the handle's present pose is reported as X_WH and motions relative to it; a
  /// simulated device starts its life anew there, at rest.
  virtual void align(const Pose& X_WH) noexcept = 0;
  virtual void enable() noexcept = 0;
  /// Motors off. Wrenches are ignored until enable().
  virtual void disable() noexcept = 0;
  /// Whether guide() has a hand to hold.
  virtual bool guidable() const noexcept { return false; }
  /// A person far away holds the hand of a simulated device at X_WTarget; empty: lets go.
  virtual void guide(const std::optional<Pose>& /*X_WTarget*/) noexcept {}
  /// Present state; empty if the device failed.
  virtual std::optional<DeviceState> read() noexcept = 0;
  /// Commands the wrench that the device exerts on the hand at the handle's origin, world axes,
  /// until the next call. False if the device failed.
  virtual bool write(const Wrench& F) noexcept = 0;
};

}  // namespace hlm::server
