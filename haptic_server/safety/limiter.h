// The last gate before the device: a wrench is finite, limited in size and in rate, and fades.
#pragma once

#include <algorithm>

#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/haptic_server/safety/force_budget.h"
#include "hlm/haptic_server/safety/impulse_spreader.h"
#include "hlm/haptic_server/safety/limiter_options.h"
#include "hlm/haptic_server/safety/motor_warmth.h"

namespace hlm::server {

/// How far the force has risen or faded.
enum class ForceLevel {
  kNone,  ///< Nothing is commanded.
  kSome,
  kFull,  ///< It is no longer held back.
};

class Limiter {
 public:
  /// dt: servo period, s.
  Limiter(const LimiterOptions& allowed, const DeviceRatings& device, double dt) noexcept;

  /// Where the force is heading: full where it is wanted, fading to none where it is not. Once in
  /// each step, with a session and without.
  void allow(bool wanted) noexcept {
    tank_.pass(dt_);
    warmth_.pass(command_.head<3>().norm(), says_warm_, dt_);
    wanted_ = wanted;
  }
  /// No force from this very step on.
  void cut() noexcept;
  /// A session begins: what force is left falls at its rate, and new force rises from none.
  void restart() noexcept;
  /// A person at the device lets it go on: the energy that it gave too much is forgiven.
  void settle() noexcept { tank_.settle(); }
  ForceLevel level() const noexcept {
    if (portion_ == 1) return ForceLevel::kFull;
    const bool none = portion_ == 0 && !wanted_ && command_.isZero(0);
    return none ? ForceLevel::kNone : ForceLevel::kSome;
  }

  /// Share of the wanted wrench that is rendered, 0 to 1, as force rises and falls.
  double portion() const noexcept { return portion_; }

  /// The handle is at X_WD now; supply: the work since the latest command that is explained besides
  /// that of the weight in it, J. Keeps the ledger of the port.
  void observe(const Pose& X_WD, double supply) noexcept {
    tank_.observe(X_WD, command_, weight_, supply);
  }
  /// Whether the device itself says that its motors get warm.
  void warm(bool says_warm) noexcept { says_warm_ = says_warm; }
  /// Whether the force is kept lower so that the motors cool.
  bool cools() const noexcept { return warmth_.cools(); }
  /// The work of the latest command on the handle's way to X_WD, J.
  double work_until(const Pose& X_WD) const noexcept { return tank_.work_until(X_WD, command_); }
  /// The work of a step that moving constraints explain, J, of the power with which they push in
  /// the world, W.
  double explained(double power) const noexcept {
    return std::clamp(power / scale_, 0.0, budget_.max_power + budget_.max_turning_power) * dt_;
  }
  const ForceBudget& budget() const noexcept { return budget_; }
  const PortLedger& ledger() const noexcept { return tank_.ledger(); }
  /// What the port never exceeds: EnergyTank::bound(), J, and power in the long run, W.
  double energy_bound() const noexcept { return tank_.bound(); }
  double power_bound() const noexcept { return budget_.energy.claim_power; }
  /// Whether the device gave more energy than the limits on force could hold back.
  bool overdrawn() const noexcept { return tank_.overdrawn(); }

  /// The wrench to command for the wanted one, and for an impulse (N·s, N·m·s) with it. The
  /// wanted wrench is limited in magnitude, then scaled by the fade: in this order one far above
  /// the limit fades like any other. The impulse is spread over what is left. With V, the
  /// handle's twist in the world, their sum gives no more power than the budget and the tank have,
  /// and changes by no more per step than the budget has. weight: the part of F that is the tool's
  /// weight. What is not finite gives zero.
  const Wrench& limit(const Wrench& F, const Wrench& impulse = Wrench::Zero(),
                      const Twist& V = Twist::Zero(),
                      const Wrench& weight = Wrench::Zero()) noexcept;
  /// The share of impulses in the latest limit().
  const Wrench& impulse_wrench() const noexcept { return spreader_.wrench(); }
  /// What kept the latest limit() from giving the wanted wrench.
  ForceLimit limited_by() const noexcept { return limited_by_; }
  /// Whether the latest limit() met a wrench that was not finite.
  bool met_non_finite() const noexcept { return met_non_finite_; }

 private:
  Wrench limit_power(const Wrench& F, const Twist& V) noexcept;

  ForceBudget budget_;
  double dt_;
  double scale_;         ///< Metres in the world for each metre of the handle.
  double torque_scale_;  ///< N·m in the world for each N·m at the handle.
  double fade_step_;     ///< Change of portion_ per step.
  double rise_step_;     ///< Rise of portion_ per step.
  double portion_ = 0;   ///< Share of the limited wrench that is rendered, 0 to 1.
  bool wanted_ = false;
  bool says_warm_ = false;
  bool met_non_finite_ = false;
  ForceLimit limited_by_ = ForceLimit::kNone;
  ImpulseSpreader spreader_;
  MotorWarmth warmth_;
  Wrench steady_ = Wrench::Zero();   ///< The command without its impulses.
  Wrench command_ = Wrench::Zero();  ///< The latest.
  Wrench weight_ = Wrench::Zero();   ///< The part of it that is the tool's weight.
  EnergyTank tank_;
};

}  // namespace hlm::server
