// How an update from the virtual environment becomes local contacts (docs/method.md 2, Eqs. 1-6).
#pragma once

#include <optional>

#include "hlm/haptic_server/local_model/local_contact.h"
#include "hlm/haptic_server/local_model/parameters.h"
#include "hlm/haptic_server/local_model/placed_reports.h"

namespace hlm::server {

/// s⁺, the local separation that a contact is given at an update, m.
/// sigma: true separation at the present poses; s_p: separation of the existing local contact with
/// the same identity, empty for a new one.
double updated_separation(UpdateRule rule, double sigma, std::optional<double> s_p) noexcept;

/// How adopt_update() changes separations.
struct UpdatePolicy {
  UpdateRule rule = UpdateRule::kRetain;
  double release_force = 0.5;  ///< `releases_load`: largest change of a force in a step, N.
  double stiffness = 4000;     ///< k, N/m, after limiting.
  double damping = 30;         ///< b, N·s/m, after limiting.
  double healing_step = 0;     ///< Healing: largest change of s in a step that adds force, m,
  double healing_share = 0;    ///< and largest share of the deformation at the update.
  int recovery_steps = 10;     ///< `ramps_depth`: N.

  UpdateRuleTraits traits() const noexcept { return hlm::traits(rule); }

  /// Largest change of s in a step, m.
  double release_step() const noexcept { return release_force / stiffness; }
};

/// Gives a contact whose point is undeformed, at separation sigma, the separation of the update
/// rule. s_p: as in updated_separation(). X_WA: pose of side a.
void deform(LocalContact& contact, const Placement& X_WA, double sigma, std::optional<double> s_p,
            const UpdatePolicy& policy) noexcept;

/// s_p of a known contact with the separation s: one that is released carries at most its cap.
double held_separation(const LocalContact& known, double s, const UpdatePolicy& policy) noexcept;

/// The friction anchor and the history of a known contact go on.
void inherit(LocalContact& contact, const LocalContact& known) noexcept;

/// `releases_load`: from now on an evaluated contact that carries load is released, not dropped.
/// False if it carries none.
bool release(LocalContact& contact, const UpdatePolicy& policy) noexcept;
/// `releases_load`: a contact that carries load but is no longer there is released, not dropped.
/// Where its body is no longer in the update its constraint stays in the world. Empty if it carries
/// none, or if its point's body is gone.
std::optional<LocalContact> released(LocalContact contact, const UpdateFrames& frames,
                                     const UpdatePolicy& policy) noexcept;

/// Adds the released contacts for which there is room: the most loaded. Sorts all by identity.
void add_released(LocalContacts& updated, LocalContacts& orphans) noexcept;

/// Places the local contact point so that Eq. 3 gives s_plus with the frame of a at X_WA, over the
/// foot of a's true point x_W on the constraint: deforms the proxy.
void place_contact_point(LocalContact& contact, const Placement& X_WA, const Vector3& x_W,
                         double sigma, double s_plus) noexcept;

/// A new contact at the end of the list. emplace_back() would fill it with zeros first.
LocalContact& add_to(LocalContacts& contacts) noexcept;
/// Whether a side is a body that the local model moves.
bool touches_body(const LocalContact& contact) noexcept;

/// Whether a frame of an update is that of a body that the environment moves, and the local model
/// ahead of its reports.
bool is_ahead(FrameIndex frame, const UpdateFrames& frames) noexcept;
/// Whether a side is such a body.
bool touches_reported(const LocalContact& contact, const UpdateFrames& frames) noexcept;
/// The contact goes over to the frames of an update's bodies. False if they lack one of its own.
bool goes_over(LocalContact& contact, const UpdateFrames& frames) noexcept;

/// The contacts of the tool after an update into `updated` (`existing` is in another object:
/// contacts are large, so callers keep two sets and swap roles). existing: the contacts before,
/// sorted by identity, their constraints advanced to now. reported: contacts of
/// the environment, `age` seconds old where their constraint is the world's. Those without the
/// tool, of links that it does not have, or with the identity of one before them are left out.
/// Returns the energy that loaded contacts with movable bodies may heal with for it, J: a body that
/// was pushed here farther than there has taken work that it did not do.
double adopt_update(const LocalContacts& existing, const ReportedContacts& reported,
                    const UpdateFrames& frames, double age, const UpdatePolicy& policy,
                    LocalContacts& updated) noexcept;

/// Nothing is known of the bodies any more: the contacts of the tool with them stay in the world
/// as contacts that are no longer reported. frames: without bodies,
/// except `before`.
void release_bodies(LocalContacts& contacts, const UpdateFrames& frames,
                    const UpdatePolicy& policy) noexcept;

/// The contacts of the bodies without the tool, as they were when the environment found them.
/// Nobody feels them, so they begin with the load that is reported, on a penalty of `stiffness`
/// (N/m).
void adopt_supports(const LocalContacts& existing, const ReportedContacts& reported,
                    const UpdateFrames& frames, double stiffness, LocalContacts& updated) noexcept;

/// Moves constraints with their v_constr, and separations by what updates have deferred, for a step
/// of dt seconds. poses: at the end of the step. Contacts that are released and no longer reported
/// go. tank: energy that healing may add, J (docs/method.md 12).
void advance_contacts(LocalContacts& contacts, const FramePoses& poses, const UpdatePolicy& policy,
                      double dt, double& tank) noexcept;

/// Moves constraints in the world's frame with their v_constr for dt seconds.
void advance_constraints(LocalContacts& contacts, double dt) noexcept;

/// Eq. 3: separation of the contact with the frames at these poses, m.
inline double separation(const LocalContact& contact, const FramePoses& poses) noexcept {
  const Placement& X_WA = poses[contact.frame_a];
  const Placement& X_WB = poses[contact.frame_b];
  const Vector3 n_W = normal_W(contact, X_WA, X_WB);
  return n_W.dot(X_WA * contact.deformation.p_A - constraint_point_W(contact, X_WB));
}

}  // namespace hlm::server
