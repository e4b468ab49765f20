// The passivity observer at the device port, and the power that it still allows
// (docs/method.md 13; after Hannaford and Ryu 2002).
#pragma once

#include "common/spatial.h"

namespace hlm::server {

/// What has passed the device port since the session began, J.
struct PortLedger {
  double given = 0;  ///< To the hand, over all periods in which it was given any.
  double taken = 0;  ///< From the hand, likewise.
  /// Of what was given less what was taken: weight, moving constraints, and in four channels the
  /// measured work of the hand on the proxy.
  double explained = 0;
  double tank = 0;  ///< What may still be given beyond that.
};

/// Keeps the ledger. Each period counts F · Δx, exact for a wrench that is held while the handle
/// moves from one sample to the next; a turn counts as one about a fixed axis. What is given and
/// not explained comes out of a tank, what is taken goes into it up to its capacity. So in any
/// stretch of time the port gives no more than what it took, what is explained and one tank.
class EnergyTank {
 public:
  /// The power that may be given is the tank's level over this time, s. Longer softens the return
  /// of springs while the tank is low, shorter lets the force drop within a few steps.
  static constexpr double kDrainTime = 0.02;

  /// capacity: J, > 0.
  explicit EnergyTank(double capacity) noexcept : capacity_(capacity), ledger_{.tank = capacity} {}

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

  const PortLedger& ledger() const noexcept { return ledger_; }
  /// Largest power that may be given now, W; below 0 so much must be taken.
  double allowed_power() const noexcept { return ledger_.tank / kDrainTime; }
  /// Whether more than a second tank was given, so that what is commanded does not stop it, or the
  /// ledger is not finite.
  bool overdrawn() const noexcept { return !(ledger_.tank >= -capacity_); }

 private:
  double capacity_;
  bool known_ = false;  ///< Whether a handle was seen.
  Pose X_WD_;           ///< At the beginning of the period.
  PortLedger ledger_;
};

}  // namespace hlm::server
