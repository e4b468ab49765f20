// The hand's wrench on a handle, estimated from how the handle moves.
#pragma once

#include <cstddef>
#include <vector>

#include "hlm/common/spatial.h"
#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// The bandwidth, at most `asked`, Hz, at which one encoder step of the device changes the estimate
/// by 0.05 N at most.
double quiet_bandwidth(const DeviceRatings& device, double asked, double dt) noexcept;

/// A disturbance observer (docs/method.md 14): a model of the handle, M dV/dt = F_motor + F - B V,
/// is drawn to where the handle is, and F, the wrench that it takes to draw it there, is the
/// hand's. With a true model F follows the hand as a Butterworth low-pass of third order does,
/// whatever the motors give. What the model does not know counts as the hand's: dry friction,
/// weight that the device does not carry, motors that give something else than was commanded.
class HandObserver {
 public:
  /// The estimate is never more than the device's rated force and torque: a loop that stood still
  /// for some periods would else find a blow. Inertia is taken from `device`, in the handle's own
  /// axes the same in all directions; what it rates with 0, and where
  /// it does not move, has no wrench. Its damping counts for
  /// translation. bandwidth: where F has fallen by 3 dB, Hz, > 0; dt: period of observe(), s, > 0.
  HandObserver(const DeviceRatings& device, double bandwidth, double dt);

  /// The handle is at rest at X_WD, nobody holds it, and no command is under way.
  void restart(const Pose& X_WD) noexcept;
  /// The motors are commanded F from here on.
  void command(const Wrench& F) noexcept;
  /// A period later the handle is at X_WD. `powered`: whether its motors gave what they were
  /// commanded. Returns the hand's wrench, world axes, about the handle's origin.
  const Wrench& observe(const Pose& X_WD, bool powered) noexcept;

 private:
  Vector6 mobility_;  ///< 1/kg and 1/(kg·m²); 0 where it is not known.
  Vector6 inertia_;
  Vector6 damping_;
  double max_force_;   ///< N.
  double max_torque_;  ///< N·m.
  double dt_;
  /// What of the distance between handle and model goes into the model's pose, twist and wrench.
  double pose_gain_;
  double twist_gain_;  ///< 1/s.
  double force_gain_;  ///< 1/s².

  Pose X_WM_;  ///< The model of the handle.
  Twist V_WM_ = Twist::Zero();
  Wrench F_ = Wrench::Zero();
  /// Commands under way, as many as the delay has periods, and the one that acts; the latest is at
  /// newest_, the oldest behind it.
  std::vector<Wrench> commands_;
  std::size_t newest_ = 0;
};

}  // namespace hlm::server
