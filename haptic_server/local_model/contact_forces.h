// Penalty and friction forces of the local contacts, and the step that they take part in
// (docs/method.md 4.1 to 4.3).
#pragma once

#include <array>

#include "common/tool_model.h"
#include "haptic_server/local_model/local_contact.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

/// What every contact of a step shares.
struct ContactLaw {
  double stiffness = 0;         ///< k, N/m, after limiting.
  double damping = 0;           ///< b, N·s/m.
  double static_friction = 0;   ///< μ_s.
  double kinetic_friction = 0;  ///< μ_k.
  double dt = 0;                ///< Step, s.
  ContactStep step = ContactStep::kImplicit;
};

/// The proxy's links at one configuration: where they are and how q̇ moves them.
class LinkMotion {
 public:
  explicit LinkMotion(const ToolModel& proxy) noexcept;

  int count() const noexcept { return static_cast<int>(J_.size()); }
  int dof() const noexcept { return static_cast<int>(J_.front().cols()); }
  const Jacobian& jacobian(int link) const noexcept { return J_[static_cast<std::size_t>(link)]; }
  const Pose& pose(int link) const noexcept { return X_WL_[static_cast<std::size_t>(link)]; }

  /// The contact's point from the link's origin, world axes, m.
  Vector3 arm(const LocalContact& contact) const noexcept {
    return pose(contact.link()).R * contact.p_L;
  }

 private:
  StaticVector<Jacobian, kMaxLinks> J_;  ///< Of the links' origins.
  StaticVector<Pose, kMaxLinks> X_WL_;
};

/// Twists of the links' origins for q̇.
using LinkTwists = StaticVector<Twist, kMaxLinks>;
LinkTwists link_twists(const LinkMotion& links, const Velocity& v) noexcept;

/// Evaluates s (Eq. 3), v_n and the contact's state for the present configuration and q̇.
void evaluate_contacts(LocalContacts& contacts, const LinkMotion& links,
                       const LinkTwists& twists) noexcept;

/// Contact forces for a step from the evaluated contacts that ends with `twists`; sets f_W, the
/// friction anchors and whether each contact slips and is loaded. Returns Σ J_iᵀ f_i.
/// f_n = max(0, -k s - b v_n), s at the end of the step for the implicit step, else at its start;
/// friction sticks elastically up to μ_s f_n and slips at μ_k f_n.
GeneralisedForce apply_contact_forces(LocalContacts& contacts, const LinkMotion& links,
                                      const LinkTwists& twists, const ContactLaw& law) noexcept;

/// Solves E v⁺ = r + dt Σ J_iᵀ f_i(v⁺) for v⁺, with E = D + … of everything but the contacts, and
/// the contact forces above. Contacts that would pull are let go and contacts that would exceed
/// their friction slip, in at most kMaxPasses rounds; the modes of the step before are tried first.
Velocity solve_contact_step(const LocalContacts& contacts, const LinkMotion& links,
                            const MassMatrix& E, const GeneralisedForce& r,
                            const ContactLaw& law) noexcept;

/// Σ J_iᵀ n nᵀ J_i over all contacts, d×d: how their stiffness adds up per unit of k.
MassMatrix unit_stiffness(const LocalContacts& contacts, const LinkMotion& links) noexcept;

}  // namespace hlm::server
