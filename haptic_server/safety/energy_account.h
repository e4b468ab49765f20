// What explains the work of the device port (docs/method.md 13).
#pragma once

#include <algorithm>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/haptic_server/safety/hand_work.h"

namespace hlm::server {

/// The work of the hand, of weight, external wrenches and moving constraints, less what the proxy
/// keeps of it as motion: so much may the port give to the hand. All in J at the handle.
class EnergyAccount {
 public:
  /// capacity: of an observed hand's work that waits to be credited, J. dt: servo period, s.
  EnergyAccount(const DeviceRatings& device, double capacity, double dt) noexcept
      : hand_work_(device, capacity), scale_(device.scale), dt_(dt) {}

  void begin() noexcept;
  /// A period ends with the handle at X_WD and its twist V_WD.
  void observe(const Pose& X_WD, const Twist& V_WD, const PortLedger& port) noexcept {
    hand_work_.observe(X_WD, V_WD, port.given - port.taken);
  }
  /// An update changed the energy in the springs of contacts, J.
  void adopted(double before, double after) noexcept { brought_ += std::max(0.0, after - before); }
  /// A step in which the proxy took the device's pose. moved: what moving constraints explain, J.
  void follow(double moved) noexcept { supply_ = moved; }
  /// The model's step from its hand frame at X_WP on, under the hand's wrench; `observed`: that is
  /// an estimate. twice: moving constraints push the proxy and the device.
  void step(const LocalModel& model, const Pose& X_WP, const Wrench& F_hand, bool observed,
            double moved, bool twice) noexcept;

  /// What the latest step explains, J.
  double supply() const noexcept { return supply_; }
  /// What updates brought into contacts' springs in the session, J in the world.
  double brought() const noexcept { return brought_; }

 private:
  HandWork hand_work_;
  double scale_;  ///< Metres in the world for each metre of the handle.
  double dt_;
  double in_proxy_ = 0;  ///< What the proxy keeps of the work of hand and weight, J.
  double supply_ = 0;
  double brought_ = 0;
};

}  // namespace hlm::server
