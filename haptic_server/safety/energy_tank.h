// The passivity observer at the device port, and the power that it still allows
// (docs/method.md 13; after Hannaford and Ryu 2002).
#pragma once

#include "hlm/common/spatial.h"

namespace hlm::server {

/// Work at the handle, J, of a wrench in the world over a displacement there. scale: metres in the
/// world for each metre of the handle. Whatever the scale of rotation, torques are scaled so that
/// this holds (DeviceRatings::torque_scale).
inline double work_at_handle(const Wrench& F, const Vector6& moves, double scale) noexcept {
  return (F.head<3>().dot(moves.head<3>()) + F.tail<3>().dot(moves.tail<3>())) / scale;
}

/// What has passed the device port since the session began, J at the handle.
struct PortLedger {
  double given = 0;  ///< Energy to the hand, over all periods in which it was given any.
  double taken = 0;  ///< Energy from the hand, over all periods in which it was taken.
  /// Part of given less taken that is explained: weight, moving constraints, and in four channels
  /// the measured work of the hand on the proxy.
  double explained = 0;
  double tank = 0;  ///< What may still be given beyond that.
};

/// Keeps the ledger. Each period counts F · Δx, exact for a wrench that is held while the handle
/// moves from one sample to the next; a turn counts as one about a fixed axis. What is given and
/// not explained comes out of a tank, what is taken goes into it up to its capacity. So in any
/// stretch of time the port gives no more than what it took, what is explained and one tank; and
/// one more for each kRefillTime without force.
class EnergyTank {
 public:
  /// The power that may be given is the tank's level over this time, s. Longer softens the return
  /// of springs while the tank is low, shorter lets the force drop within a few steps.
  static constexpr double kDrainTime = 0.02;
  /// Time without force that fills an empty tank, s. A hand that moves into a wall meanwhile is
  /// pushed out again by energy that nothing explains. Longer lets the wall give way after a few
  /// pauses of the client, shorter lets a client that stalls on purpose give more.
  static constexpr double kRefillTime = 0.5;

  /// capacity: J, > 0; scale: metres in the world for each metre of the handle.
  explicit EnergyTank(double capacity, double scale = 1) noexcept
      : capacity_(capacity), scale_(scale), ledger_{.tank = capacity} {}

  /// A session begins. The tank stays as it is, for a client could ask for ever new sessions, but
  /// owes nothing.
  void begin() noexcept {
    ledger_ = {.tank = ledger_.tank > 0 ? ledger_.tank : 0};
    known_ = false;
  }

  /// A period ends with the handle at X_WD. F: the wrench that was commanded in it; weight: the
  /// part of F that is the tool's weight, whose work is a potential; supply: what else explains
  /// the work in it, J.
  void observe(const Pose& X_WD, const Wrench& F, const Wrench& weight, double supply) noexcept;
  /// Says that there was no force for that long, s.
  void rest(double time) noexcept;

  const PortLedger& ledger() const noexcept { return ledger_; }
  /// Largest power that may be given now, W; below 0: that much must be taken.
  double allowed_power() const noexcept { return ledger_.tank / kDrainTime; }
  /// Whether more than a second tank was given, so that what is commanded does not stop it, or the
  /// ledger is not finite.
  bool overdrawn() const noexcept { return !(ledger_.tank >= -capacity_); }

 private:
  double capacity_;
  double scale_;
  bool known_ = false;  ///< Whether a handle was seen.
  Pose X_WD_;           ///< Pose at the beginning of the period.
  PortLedger ledger_;
};

}  // namespace hlm::server
