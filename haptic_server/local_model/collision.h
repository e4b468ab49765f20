// Simultaneous frictionless collisions of the proxy with static constraints (docs/method.md 5,
// Eqs. 9-11).
#pragma once

#include <Eigen/Cholesky>

#include "common/tool_model.h"
#include "haptic_server/local_model/local_contact.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

/// d×m: column i is J_iᵀ n_i, so that J_c is its transpose.
using ContactNormals =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDof, kMaxLocalContacts>;

/// J_cᵀ p, the generalised impulse (N·s, N·m·s) that resolves the collisions, length d.
/// D: Cholesky factor of the mass matrix; normals: of all colliding and penetrating contacts;
/// v: q̇₀ before the collision; restitution: e.
/// kNewton gives Eq. 11, p = -(1+e)(J_c D⁻¹ J_cᵀ)⁺ J_c q̇₀; kNonnegative the p >= 0 for which
/// p ⟂ J_c D⁻¹ J_cᵀ p + (1+e) J_c q̇₀ >= 0. Neither adds kinetic energy.
GeneralisedForce collision_impulse(CollisionRule rule, const Eigen::LLT<MassMatrix>& D,
                                   const ContactNormals& normals, const Velocity& v,
                                   double restitution) noexcept;

}  // namespace hlm::server
