// How far stiffness is scaled so that all contacts together stay renderable (docs/method.md 4.5).
#pragma once

#include <Eigen/Cholesky>

#include "common/tool_model.h"
#include "haptic_server/local_model/hand_map.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

/// Whether any limit is set.
bool limits_stiffness(const LocalModelParameters& parameters) noexcept;

/// The factor in (0, 1] for k and b: the largest that keeps the stiffness at the hand (force over
/// translation, torque over rotation) and the natural frequency sqrt(λ_max(D⁻¹ K)) within the
/// parameters' limits.
/// unit_stiffness: Σ J_iᵀ n nᵀ J_i, d×d; D: Cholesky factor of the mass matrix; H: hand map.
double stiffness_scale(const MassMatrix& unit_stiffness, const Eigen::LLT<MassMatrix>& D,
                       const HandMap& H, const LocalModelParameters& parameters) noexcept;

}  // namespace hlm::server
