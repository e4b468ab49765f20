// The force on a device's gripper, and the energy that goes through its finger (docs/method.md 13).
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/haptic_server/safety/force_budget.h"

namespace hlm::server {

/// A port of one coordinate, the finger's way, with a tank of its own. Nothing explains its energy:
/// in a session it gives what it takes and two tanks, whatever a client says.
class GripPort {
 public:
  /// dt: servo period, s.
  GripPort(const ForceBudget& budget, const DeviceRatings& device, double dt) noexcept
      : travel_(device.gripper_travel),
        dt_(dt),
        most_(std::min(device.max_gripper_force, budget.max_force)),
        step_(budget.max_force_step),
        tank_({.capacity = std::min(budget.energy.capacity, most_ * ForceBudget::kWholeForceWay)}) {
  }

  void begin() noexcept {
    tank_.begin();
    force_ = speed_ = 0;
    finger_.reset();
  }
  void settle() noexcept { tank_.settle(); }
  void drop() noexcept { force_ = 0; }

  /// A period ends with that opening, 0 closed to 1 open; without one there is no force. halted:
  /// the motors may have been off in it.
  void observe(std::optional<double> opening, bool halted) noexcept {
    if (!opening) {
      drop();
      return finger_.reset();
    }
    const double way = finger_ ? *opening * travel_ - *finger_ : 0;
    if (halted && force_ * way < 0) drop();
    finger_ = *opening * travel_;
    speed_ = way / dt_;
    tank_.observe({{*finger_, 0, 0}, Quaternion::Identity()}, Wrench(force_ * Wrench::UnitX()),
                  Wrench::Zero(), 0);
  }
  bool overdrawn() const noexcept { return tank_.overdrawn(); }
  const PortLedger& ledger() const noexcept { return tank_.ledger(); }

  /// The force to command for the wanted one, N at the finger; positive opens. portion: of it that
  /// is rendered as force rises and fades. What is not finite gives none, nor does a gripper that
  /// is not read.
  double limit(double wanted, double portion) noexcept {
    const bool known = finger_ && std::isfinite(wanted);
    double force = known ? portion * std::clamp(wanted, -most_, most_) : 0;
    const double allowed = std::max(tank_.allowed_power(), 0.0);
    if (force * speed_ > allowed) force = allowed / speed_;
    return force_ += std::clamp(force - force_, -step_, step_);
  }

 private:
  double travel_;  ///< From closed to open, m.
  double dt_;
  double most_;                   ///< N.
  double step_;                   ///< Change of force in a period, N.
  double force_ = 0;              ///< The latest, N.
  double speed_ = 0;              ///< m/s.
  std::optional<double> finger_;  ///< Its way from closed, m, if it was seen.
  EnergyTank tank_;
};

}  // namespace hlm::server
