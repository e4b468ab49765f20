// How an update from the virtual environment becomes local contacts (docs/method.md 2, Eqs. 1-6).
#pragma once

#include <optional>

#include "common/contact.h"
#include "common/tool_model.h"
#include "haptic_server/local_model/local_contact.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

/// s⁺, the local separation that a contact is given at an update, m.
/// sigma: true separation at the present proxy pose; s_p: separation of the existing local contact
/// with the same identity, empty for a new one.
double updated_separation(UpdateRule rule, double sigma, std::optional<double> s_p) noexcept;

/// How adopt_update() changes separations.
struct UpdatePolicy {
  UpdateRule rule = UpdateRule::kRetain;
  double release_step = 0;  ///< `retain`: largest change of s in a step, m: Δf / k.
  int recovery_steps = 10;  ///< `plane_recovery`: N.
};

/// The local contacts after an update, sorted by identity, into `updated` (another object than
/// `existing`: contacts are large, so callers keep two sets and swap roles).
/// existing: the contacts before, sorted by identity, their constraints advanced to now.
/// reported: contacts of the environment for the tool at `ve_tool`, `age` seconds old. Those
/// without the tool on side a, between two links, or with the identity of one before them are left
/// out. proxy: the tool at the proxy's present configuration.
void adopt_update(const LocalContacts& existing, const ReportedContacts& reported,
                  const ToolModel& ve_tool, const ToolModel& proxy, double age,
                  const UpdatePolicy& policy, LocalContacts& updated) noexcept;

/// Moves constraints with their v_constr, and separations by what updates have deferred, for a step
/// of dt seconds. Contacts that are released and no longer reported go.
void advance_contacts(LocalContacts& contacts, const ToolModel& proxy, double dt) noexcept;

/// Eq. 3: separation of the contact at the proxy's configuration, m.
inline double separation(const LocalContact& contact, const ToolModel& proxy) noexcept {
  return contact.n_W.dot(proxy.X_WL(contact.link()) * contact.p_L - contact.c_W);
}

}  // namespace hlm::server
