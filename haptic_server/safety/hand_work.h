// What the hand can have done to the handle, where nobody measures it (docs/method.md 14).
#pragma once

#include <algorithm>

#include "hlm/common/spatial.h"
#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// An observed hand is an estimate, and what it does to the proxy explains energy at the port. This
/// bounds it by what the handle itself tells: the kinetic energy that it gained, the work of its
/// damping, less the work of the commands. In any stretch of time no more is credited than that and
/// one capacity, so that an estimate that is wrong in phase, or goes on while the handle rests,
/// explains nothing.
class HandWork {
 public:
  /// capacity: of work that waits to be credited, J, > 0.
  HandWork(const DeviceRatings& device, double capacity) noexcept;

  /// A session begins: the handle may be elsewhere. What waits stays, what is lacking is forgotten.
  void begin() noexcept {
    known_ = false;
    if (!(waiting_ >= 0)) waiting_ = 0;
  }
  /// A period ends with the handle at X_WD and its twist V_WD; given: the work of all commands on
  /// it since the session began, J at the handle.
  void observe(const Pose& X_WD, const Twist& V_WD, double given) noexcept;
  /// Part of the estimated hand's work on the proxy, J at the handle, that may explain other work.
  double credited(double work) noexcept;

 private:
  Vector6 inertia_;  ///< kg, kg·m².
  Vector6 damping_;  ///< N·s/m; none in rotation.
  double scale_;     ///< Metres in the world for each metre of the handle.
  double capacity_;
  double waiting_;  ///< Work of the hand that is not yet credited, J.

  bool known_ = false;  ///< Whether a handle was seen.
  Pose X_WD_;           ///< Pose at the beginning of the period.
  double kinetic_ = 0;  ///< Kinetic energy at that time, J at the handle.
  double given_ = 0;    ///< Energy given until then, J.
};

}  // namespace hlm::server
