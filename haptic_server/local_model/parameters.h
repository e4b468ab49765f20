// What the user sets of the local model.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>

#include "hlm/common/range.h"
#include "hlm/common/tuning.h"
#include "hlm/common/vocabulary.h"

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

  /// Largest speed at which a loaded contact comes back to where it is reported, m/s; 0: never.
  /// Faster is felt as a push, slower leaves a wall that arrived late where it was met for longer.
  double healing_speed = 0.05;

  int recovery_steps = 10;  ///< N of rule `plane_recovery`, steps of the loop, >= 1.

  /// Stiffness that all contacts together may show at the hand in one direction, as a multiple of
  /// that of one contact. More lets a plate on 64 contacts feel harder than on 4, which is what a
  /// face of a box has; less makes that face softer. Infinite: stiffness adds up.
  double max_stiffness_sum = 4;

  /// Largest stiffness that all contacts together may show at the hand, N/m and N·m/rad, and
  /// largest natural frequency of the proxy on its contacts, rad/s. The stiffness of all contacts
  /// is scaled by one factor to stay below all of these limits.
  double max_hand_stiffness = std::numeric_limits<double>::infinity();
  double max_hand_angular_stiffness = std::numeric_limits<double>::infinity();
  double max_contact_frequency = std::numeric_limits<double>::infinity();
};

inline constexpr std::array<NumberOf<LocalModelParameters>, 11> kLocalModelNumbers{{
    {range_of(&Tuning::stiffness), "stiffness", &LocalModelParameters::stiffness,
     "Stiffness of each contact"},
    {range_of(&Tuning::damping), "damping", &LocalModelParameters::damping,
     "Damping of each contact"},
    {range_of(&Tuning::restitution), "restitution", &LocalModelParameters::restitution,
     "Coefficient of restitution of the proxy; without a proxy (direct coupling and the rivals) "
     "nothing collides but the device itself"},
    {range_of(&Tuning::friction), "static friction", &LocalModelParameters::static_friction,
     "Coefficient of static friction, at least the kinetic one"},
    {range_of(&Tuning::friction), "kinetic friction", &LocalModelParameters::kinetic_friction,
     "Coefficient of kinetic friction"},
    {{1e-6, 1e6, "N"},
     "release step",
     &LocalModelParameters::release_step,
     "Largest step of a contact's force while retained load is released"},
    {{0, 1, "m/s"},
     "healing speed",
     &LocalModelParameters::healing_speed,
     "Largest speed at which a loaded contact comes back to where it is reported; 0: never"},
    {{0, Range::kInfinite, "", true},
     "max stiffness sum",
     &LocalModelParameters::max_stiffness_sum,
     "Largest stiffness of all contacts together at the hand, in stiffnesses of one contact"},
    {{0, Range::kInfinite, "N/m", true},
     "max hand stiffness",
     &LocalModelParameters::max_hand_stiffness,
     "Largest stiffness of all contacts together at the hand"},
    {{0, Range::kInfinite, "N·m/rad", true},
     "max hand angular stiffness",
     &LocalModelParameters::max_hand_angular_stiffness,
     "Largest angular stiffness of all contacts together at the hand"},
    {{0, Range::kInfinite, "rad/s", true},
     "max contact frequency",
     &LocalModelParameters::max_contact_frequency,
     "Largest natural frequency of the proxy on its contacts"},
}};
inline constexpr Range kRecoverySteps{1, 1e6, "steps"};

/// Why parameters cannot be used, naming the parameter, its value and its range; empty if valid.
std::optional<std::string> find_error(const LocalModelParameters& parameters);

}  // namespace hlm::server
