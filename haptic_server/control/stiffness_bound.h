// The stiffness that a sampled and late device supports (docs/method.md 15).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hlm/haptic_server/control/controller.h"

namespace hlm::server {

/// A spring and a damper that the device feels.
struct Impedance {
  double stiffness = 0;  ///< N/m.
  double damping = 0;    ///< N·s/m.
};

/// How long after a motion the force that answers it acts, s, on average: half the period of what
/// exchanges least often, the servo (`period`, s) or the device, and the device's delay.
double lag_of(const DeviceRatings& device, double period) noexcept;

/// The handle in one direction of translation or of rotation, without a hand.
struct Handle {
  double mass = 0;          ///< kg or kg·m²; 0 if unknown.
  double damping = 0;       ///< N·s/m or N·m·s/rad; 0 if unknown.
  double lag = 0;           ///< As lag_of(), s.
  double velocity_lag = 0;  ///< How much later the velocity is, s.
  double period = 1e-3;     ///< Of the exchange, s.
};
/// The mass of a device that rates encoder steps and no mass is a usual one. The damping is what
/// the device rates, or what its rated stiffness needs at 1 kHz; in rotation always that.
Handle translation_of(const DeviceRatings& device, double period) noexcept;
Handle rotation_of(const DeviceRatings& device, double period) noexcept;

/// The share of a spring and damper, 0 to 1, that leaves `margin` of the largest with which the
/// handle is stable by itself:
///
///     |σ (k + jωb e^{-jω·velocity_lag}) e^{-jω·lag}| < |jω (jωm + b_device)|
///
/// where the phase of the left over the right is -π. For b = 0 that is Colgate's bound. 1 where
/// nobody knows what the device damps. At most some 200 frequencies, bounded in time.
double bearable_share(const Handle& handle, const Impedance& felt, double margin = 1) noexcept;

/// What one encoder step changes, and by how much it may change the force.
struct EncoderStep {
  double pose = 0;   ///< m or rad.
  double speed = 0;  ///< m/s or rad/s.
  double quiet = 0;  ///< N or N·m.
};

/// What is left of a coupling that is felt. Its damping is so small that an encoder step stays
/// unfelt, with the stiffest spring that then rests as bearable_share() says; where the damping was
/// less already, spring and damper are lowered together. At most some 2,000 frequencies.
Impedance bearable_coupling(const Handle& handle, const Impedance& felt, const EncoderStep& step,
                            double margin) noexcept;

/// What the device feels at most as a function of its own motion: with direct coupling all contacts
/// that add up; else the coupling, twice where the contact force that balances it is fed back, too.
Impedance felt_impedance(ControllerKind kind, const ControllerGains& gains,
                         const LocalModelParameters& contacts) noexcept;
/// The same in rotation, N·m/rad and N·m·s/rad: with direct coupling that of contacts on a lever of
/// 0.1 m.
Impedance felt_in_rotation(ControllerKind kind, const ControllerGains& gains,
                           const LocalModelParameters& contacts) noexcept;

/// Lowers what the device does not support with room left to come to rest: with direct coupling the
/// stiffness of all contacts together (max_hand_stiffness, max_hand_angular_stiffness), else the
/// coupling's gains, in translation and in rotation by shares of their own. Returns the share that
/// is left, 0 to 1: of all contacts together in translation, else the smaller one of the
/// coupling's. The coupling's damping is bounded too: one encoder step changes the force by
/// (damping that is felt) · DeviceRatings::speed_step, at most 0.1 N. Bounded in time: 4 to 8 µs,
/// 80 µs where the encoders bound the damping.
double bound_stiffness(ControllerKind kind, const DeviceRatings& device, double period,
                       ControllerGains& gains, LocalModelParameters& contacts) noexcept;

/// The same with a sentence for a person that says so; empty if nothing was lowered.
std::optional<std::string> lower_stiffness(ControllerKind kind, const DeviceRatings& device,
                                           double period, ControllerGains& gains,
                                           LocalModelParameters& contacts);

/// What is doubtful about controller, gains and contacts on this device at this servo period (s):
/// sentences for a person. Colgate: a wall of stiffness k and damping b is passive on a device of
/// damping b_device while b_device > kΔt/2 + |b|.
std::vector<std::string> check_against_device(ControllerKind kind, const ControllerGains& gains,
                                              const LocalModelParameters& contacts,
                                              const DeviceRatings& device,
                                              bool measures_hand_wrench, double period);

}  // namespace hlm::server
