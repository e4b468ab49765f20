// What the environment brings into the local model (docs/method.md 13).
#pragma once

#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {

/// Energy in the springs of the tool's contacts, normal and tangential, J. stiffness: of each, N/m.
double stored_energy(const LocalModel& model, double stiffness) noexcept;

/// Power with which constraints and bodies that move push the tool, W: each contact's force by the
/// velocity of its far side.
double environment_power(const LocalModel& model) noexcept;

/// Kinetic energy of the proxy, J.
double kinetic_energy(const LocalModel& model) noexcept;

}  // namespace hlm::server
