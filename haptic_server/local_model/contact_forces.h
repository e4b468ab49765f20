// Penalty and friction forces of the local contacts, and the step that they take part in
// (docs/method.md 4.1 to 4.3).
#pragma once

#include <span>

#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/local_model/contact_law.h"

namespace hlm::server {

/// Contacts and the law that they follow.
struct ContactGroup {
  LocalContacts& contacts;
  ContactLaw law;
};
using ContactGroups = std::span<const ContactGroup>;

/// Evaluates s (Eq. 3), v_n and the contacts' states at the start of the step.
void evaluate_contacts(LocalContacts& contacts, const FrameMotions& frames) noexcept;

/// Contact forces for a step from the evaluated contacts that ends with the unknowns x; sets f_W,
/// the friction anchors and whether each contact slips and is loaded. Returns Σ Jᵀ f over the
/// unknowns. f_n = max(0, -k s - b v_n), s at the end of the step for the implicit step, else at
/// its start; friction sticks elastically up to μ_s f_n and slips at μ_k f_n.
Unknowns apply_contact_forces(const ContactGroup& group, const FrameMotions& frames,
                              const Unknowns& x) noexcept;

/// The linear part of a step: E x = r + dt Σ Jᵀ f, E symmetric.
struct StepSystem {
  SystemMatrix E;
  Unknowns r;
};

/// That of a step in which nothing acts except contacts: unit mass in all unknowns.
StepSystem unit_system(const FrameMotions& frames) noexcept;

/// Solves a step with the contact forces above for x, by Newton's method with a line search
/// (docs/method.md 4.3), from the modes of the step before. A contact that would close within the
/// step takes part.
Unknowns solve_contact_step(ContactGroups groups, const FrameMotions& frames,
                            const StepSystem& system) noexcept;

}  // namespace hlm::server
