// How generalised contact forces are felt at the hand (docs/method.md 4.4, Eq. 8).
#pragma once

#include <Eigen/Cholesky>

#include "hlm/common/tool_model.h"

namespace hlm::server {

/// 6×d: wrench at the hand's frame, world axes, from a generalised force.
using HandMap = Jacobian;

/// The map H of Eq. 8, F = Λ J_h D⁻¹ τ with Λ = (J_h D⁻¹ J_hᵀ)⁺, damped near singular postures.
/// Where the tool has fewer than six degrees of freedom the pseudo-inverse weighs a rotation by the
/// tool's length (m): F is then the wrench of least |force|² + |torque/length|² with J_hᵀ F = τ.
///
/// Damping: a push of the hand along an eigenvector of its mobility J_h D⁻¹ J_hᵀ moves other links
/// up to ρ times as fast as the hand, so by virtual work contacts there are felt up to ρ times as
/// strong. Beyond ρ = 1.4 that direction is scaled by x² (2 - x²), x = 1.4/ρ: it feels at most 1.53
/// times a contact's force, and nothing in the singular posture itself. H is exact wherever ρ <=
/// 1.4 in all directions, and always for a rigid tool.
/// D: Cholesky factor of the mass matrix; J_h: hand Jacobian.
HandMap hand_map(const ToolModel& tool, const Eigen::LLT<MassMatrix>& D,
                 const Jacobian& J_h) noexcept;

}  // namespace hlm::server
