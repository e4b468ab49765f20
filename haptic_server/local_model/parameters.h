// What the user sets of the local model.
#pragma once

#include <limits>
#include <optional>
#include <string>

#include "common/vocabulary.h"

namespace hlm::server {

/// How simultaneous collisions are resolved (docs/method.md 5).
enum class CollisionRule {
  kNonnegative,  ///< Impulses never pull: the LCP with Newton's restitution.
  kNewton,       ///< Eq. 11 as printed.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::CollisionRule>, 2> kWords<server::CollisionRule>{{
    {server::CollisionRule::kNonnegative, "nonnegative", "impulses never pull"},
    {server::CollisionRule::kNewton, "newton", "Eq. 11 as printed"},
}};

}  // namespace hlm

namespace hlm::server {

/// How contact forces enter the integration (docs/method.md 4.3).
enum class ContactStep {
  kImplicit,  ///< Forces at the end of the step: stable for any stiffness.
  kExplicit,  ///< Forces at its start: stable while (2bΔt + kΔt²) λ_max(J D⁻¹ Jᵀ) < 4.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::ContactStep>, 2> kWords<server::ContactStep>{{
    {server::ContactStep::kImplicit, "implicit", "stable for any stiffness"},
    {server::ContactStep::kExplicit, "explicit", "forces at the start of the step"},
}};

}  // namespace hlm

namespace hlm::server {

struct LocalModelParameters {
  UpdateRule update_rule = UpdateRule::kRetain;
  CollisionRule collision_rule = CollisionRule::kNonnegative;
  ContactStep contact_step = ContactStep::kImplicit;

  double stiffness = 4000;        ///< k_lc, N/m, of each contact, normal and tangential.
  double damping = 30;            ///< b_lc, N·s/m, of each contact, normal and tangential.
  double restitution = 0;         ///< e, in [0, 1].
  double static_friction = 0.3;   ///< μ_s, >= μ_k.
  double kinetic_friction = 0.3;  ///< μ_k, >= 0.

  /// Largest step of a contact's spring force while retained load is released, N. Larger releases
  /// faster (at 1 kHz, 0.5 N a step is 500 N/s) and is felt as a jump from about 1 N on.
  double release_step = 0.5;

  int recovery_steps = 10;  ///< N of rule `plane_recovery`, steps of the loop, >= 1.

  /// Largest stiffness that all contacts together may show at the hand, N/m and N·m/rad, and
  /// largest natural frequency of the proxy on its contacts, rad/s. The stiffness of all contacts
  /// is scaled by one factor to stay below. Infinite: stiffness adds up unlimited.
  double max_hand_stiffness = std::numeric_limits<double>::infinity();
  double max_hand_angular_stiffness = std::numeric_limits<double>::infinity();
  double max_contact_frequency = std::numeric_limits<double>::infinity();
};

/// Why parameters cannot be used, naming the parameter, its value and its range; empty if valid.
std::optional<std::string> find_error(const LocalModelParameters& parameters);

}  // namespace hlm::server
