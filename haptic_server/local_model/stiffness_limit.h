// How far stiffness is scaled so that all contacts together stay renderable (docs/method.md 4.5).
#pragma once

#include <Eigen/Cholesky>

#include "hlm/haptic_server/local_model/frames.h"
#include "hlm/haptic_server/local_model/hand_map.h"
#include "hlm/haptic_server/local_model/local_contact.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::server {

class StiffnessLimit {
 public:
  /// The factor on the contacts' k and b in a step of dt, s: 1 unless limited. It goes to scale()
  /// gradually while something touches.
  void limit(const ToolModel& tool, const LocalContacts& contacts, const FrameMotions& frames,
             const Eigen::LLT<MassMatrix>& D, const HandMap& H,
             const LocalModelParameters& parameters, double dt) noexcept;
  double factor() const noexcept { return factor_; }

  /// The factor in (0, 1] for k and b: the largest that keeps the stiffness of all contacts at the
  /// hand (force over translation, torque over rotation) and the natural frequency sqrt(λ_max(D⁻¹
  /// K)) within the parameters' limits. The contacts are evaluated with `frames`; D: Cholesky
  /// factor of the mass matrix; H: hand map.
  double scale(const ToolModel& tool, const LocalContacts& contacts, const FrameMotions& frames,
               const Eigen::LLT<MassMatrix>& D, const HandMap& H,
               const LocalModelParameters& parameters) noexcept;

 private:
  double largest_of(const Matrix3& per_k) noexcept;

  double factor_ = 1;
  // Most steps have the normals of the step before.
  Matrix3 per_k_ = Matrix3::Zero();  ///< Force at the hand over translation, per unit of k,
  double largest_ = 0;               ///< and its largest eigenvalue.
};

}  // namespace hlm::server
