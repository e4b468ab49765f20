// The stiffness that a sampled and late device supports (docs/method.md 15).
#pragma once

#include <optional>
#include <string>

#include "hlm/control/controller.h"

namespace hlm::server {

/// A spring and a damper that the device feels.
struct Impedance {
  double stiffness = 0;  ///< N/m.
  double damping = 0;    ///< N·s/m.
};

/// How long after a motion the force that answers it acts, s, on average: half the period of what
/// exchanges least often, the servo (`period`, s) or the device, and the device's delay.
double lag_of(const DeviceRatings& device, double period) noexcept;

/// The damping that helps, N·s/m: what the device rates, or what its rated stiffness needs at
/// 1 kHz; 0 if it rates neither.
double physical_damping(const DeviceRatings& device) noexcept;

/// The largest share of a spring and damper, 0 to 1, with which the device is stable without a
/// hand:
///
///     k lag < (1 - rest) (b_device + b) (1 - b lag / 2m)
///
/// where `rest` is the share of the damping that is left over. Without the last factor that is
/// Colgate's bound for b = 0, and that of Gil et al. (2009) for a small b; the factor, ours, is
/// what a damper costs that is itself late, where the device's mass is known. 1 where nobody knows
/// what the device damps.
double bearable_share(const DeviceRatings& device, const Impedance& felt, double period,
                      double rest = 0) noexcept;

/// What the device feels at most as a function of its own motion: with direct coupling all contacts
/// that add up; else the coupling, twice where the contact force that balances it is fed back, too.
Impedance felt_impedance(ControllerKind kind, const ControllerGains& gains,
                         const LocalModelParameters& contacts) noexcept;

/// Lowers what the device does not support with damping left to come to rest: with direct coupling
/// the stiffness of all contacts together (max_hand_stiffness), else the coupling's gains. Returns
/// the share that is left, 0 to 1; 1 if nothing was lowered. Bounded in time.
double bound_stiffness(ControllerKind kind, const DeviceRatings& device, double period,
                       ControllerGains& gains, LocalModelParameters& contacts) noexcept;

/// The same with a sentence for a person that says so; empty if nothing was lowered.
std::optional<std::string> lower_stiffness(ControllerKind kind, const DeviceRatings& device,
                                           double period, ControllerGains& gains,
                                           LocalModelParameters& contacts);

}  // namespace hlm::server
