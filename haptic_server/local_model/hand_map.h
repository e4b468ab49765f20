// How generalised contact forces are felt at the hand (docs/method.md 4.4, Eq. 8).
#pragma once

#include <Eigen/Cholesky>

#include "common/tool_model.h"

namespace hlm::server {

/// 6×d: wrench at the hand's frame, world axes, from a generalised force.
using HandMap = Jacobian;

/// The map H of Eq. 8, F = Λ J_h D⁻¹ τ with Λ = (J_h D⁻¹ J_hᵀ)⁺. Where the tool has fewer than six
/// degrees of freedom the pseudo-inverse weighs a rotation by `length` (m): F is then the wrench of
/// least |force|² + |torque/length|² with J_hᵀ F = τ.
/// D: Cholesky factor of the mass matrix; J_h: hand Jacobian.
HandMap hand_map(const Eigen::LLT<MassMatrix>& D, const Jacobian& J_h, double length) noexcept;

}  // namespace hlm::server
