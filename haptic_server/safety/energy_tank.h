// The passivity observer at the device port, and the power that it still allows
// (docs/method.md 13; after Hannaford and Ryu 2002).
#pragma once

#include <algorithm>

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
  /// Part of given less taken that was let through for a reason: weight, moving constraints, and in
  /// four channels the hand's work on the proxy.
  double explained = 0;
  double tank = 0;  ///< What may still be given beyond that.
};

/// What the tank lets through, J and W at the handle.
struct EnergyLimits {
  double capacity = 0;     ///< Given beyond what was taken and is explained, J, > 0.
  double claim = 0;        ///< Explained at a stretch, J.
  double claim_power = 0;  ///< Explained in the long run, W.
};

/// Keeps the ledger. Each period counts F · Δx, exact for a wrench that is held while the handle
/// moves from one sample to the next; a turn counts as one about a fixed axis. What is given and
/// not explained comes out of a tank, what is taken goes into it up to its capacity. What is
/// explained refills it, out of an allowance, for explanations are what the client claims: it holds
/// `claim` and gains `claim_power`, and weight that the hand lifted may come down again besides, by
/// `claim` at a stretch. So whatever a client says, and however often it asks for a session, in any
/// time t
///
///     given - taken <= bound() + claim_power · t
///
/// and up to one capacity more for each settle(), which takes a person at the device.
class EnergyTank {
 public:
  /// The power that may be given is the tank's level over this time, s. Longer softens the return
  /// of springs while the tank is low, shorter lets the force drop within a few steps.
  static constexpr double kDrainTime = 0.02;

  /// scale: metres in the world for each metre of the handle.
  explicit EnergyTank(const EnergyLimits& limits, double scale = 1) noexcept
      : limits_(limits), scale_(scale), claim_(limits.claim), ledger_{.tank = limits.capacity} {}

  /// A session begins. Tank and allowance stay as they are, for a client could ask for ever new
  /// sessions; weight that was lifted is forgotten.
  void begin() noexcept {
    ledger_ = {.tank = ledger_.tank};
    lifted_ = 0;
    known_ = false;
  }
  /// A person at the device lets it go on: nothing is owed any more.
  void settle() noexcept {
    if (!(ledger_.tank >= 0)) ledger_.tank = 0;
    if (!(claim_ >= 0)) claim_ = 0;
  }

  /// A period ends with the handle at X_WD. F: the wrench that was commanded in it; weight: the
  /// part of F that is the tool's weight, whose work is a potential; supply: what else explains
  /// the work in it, J.
  void observe(const Pose& X_WD, const Wrench& F, const Wrench& weight, double supply) noexcept;
  /// The work of a wrench on the handle's way to X_WD from where it was observed, J.
  double work_until(const Pose& X_WD, const Wrench& F) const noexcept {
    return known_ ? work_at_handle(F, displacement(X_WD_, X_WD), scale_) : 0;
  }
  /// Time goes by, s: once in every period, with a session and without.
  void pass(double time) noexcept {
    claim_ = std::min(claim_ + time * limits_.claim_power, limits_.claim);
  }

  const PortLedger& ledger() const noexcept { return ledger_; }
  /// Largest power that may be given now, W; below 0: that much must be taken.
  double allowed_power() const noexcept { return ledger_.tank / kDrainTime; }
  /// Most that is given beyond what is taken and claim_power · t until overdrawn(), J.
  double bound() const noexcept { return 2 * (limits_.capacity + limits_.claim); }
  /// Whether more than a second tank was given, so that what is commanded does not stop it, or the
  /// ledger is not finite.
  bool overdrawn() const noexcept { return !(ledger_.tank >= -limits_.capacity); }

 private:
  double explain(double level, double weight, double supply) noexcept;

  EnergyLimits limits_;
  double scale_;
  double claim_;        ///< What is left of the allowance, J.
  double lifted_ = 0;   ///< What the hand did to lift the weight, at most `claim`, J.
  bool known_ = false;  ///< Whether a handle was seen.
  Pose X_WD_;           ///< Pose at the beginning of the period.
  PortLedger ledger_;
};

}  // namespace hlm::server
