// How a body answers forces as its joints leave it: what the local model must know to move it.
#pragma once

#include "hlm/common/spatial.h"

namespace hlm::ve {

/// One body's part, about its centre of mass, world axes, linear and exact. Bodies that joints
/// connect answer together, M a = f + Jᵀ λ with J a = -J̇ v for all of them. Damping of joints
/// counts as in a step of the solver: implicitly. Limits of joints take no part.
struct Mobility {
  /// The acceleration for each wrench on the body, 1/kg and 1/(kg·m²), symmetric: that body's block
  /// of M⁻¹ − M⁻¹Jᵀ (J M⁻¹ Jᵀ)⁺ J M⁻¹.
  Matrix6 W = Matrix6::Zero();
  /// The acceleration by all that is no contact: weight, springs and damping of joints, gyroscopic
  /// torque, and what its joints make of these. m/s², rad/s².
  Vector6 A_W = Vector6::Zero();
};

}  // namespace hlm::ve
