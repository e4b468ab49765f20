// The energy that contacts may use to come back to where they are reported (docs/method.md 2).
#pragma once

#include <algorithm>
#include <cmath>

namespace hlm::server {

class HealingTank {
 public:
  /// Adds energy that there is to heal with, J, up to what the tank holds.
  void fill(double energy) noexcept {
    if (std::isfinite(energy)) energy_ = std::min(energy_ + energy, kSize);
  }
  /// A step ends with so much in the springs of contacts, J: that comes back when they are let go,
  /// and so much debt is not forgotten.
  void bound_debt(double stored) noexcept { energy_ = std::max(energy_, -kSize - stored); }
  /// What there is, J; below 0 it is owed. Whoever heals takes it from here.
  double& energy() noexcept { return energy_; }
  double energy() const noexcept { return energy_; }

  /// Share in [0, 1] of the work of contacts that the device renders: the rest fills nothing.
  void set_rendered(double share) noexcept { rendered_ = share; }
  double rendered() const noexcept { return rendered_; }

 private:
  /// Most that is kept, J: that of 5 N over 20 mm. More would let an old blow pay for a wall that
  /// comes much later.
  static constexpr double kSize = 0.1;

  double energy_ = 0;
  double rendered_ = 1;
};

}  // namespace hlm::server
