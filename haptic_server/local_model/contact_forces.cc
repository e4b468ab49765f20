#include "hlm/haptic_server/local_model/contact_forces.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {
namespace {

/// What the normal force of the step before, held since, has taken on the way and the spring does
/// not store, J.
double taken_since(const LocalContact& contact, const ContactLaw& law) noexcept {
  const double depth = std::min(contact.now.s, 0.0);
  const double depth_before = std::min(contact.latest.s_left, 0.0);
  const double stored = law.stiffness * (depth * depth - depth_before * depth_before) / 2;
  // Nobody paid for the way in before a force.
  if (!contact.latest.loaded) return -std::max(0.0, stored);
  const double f_n = law.rendered * contact.latest.f_W.dot(contact.now.n_W);
  return f_n * (contact.latest.s_left - contact.now.s) - stored;
}

}  // namespace

void evaluate_contacts(LocalContacts& contacts, const FrameMotions& frames) noexcept {
  if (contacts.empty()) return;
  const FrameTwists twists = frames.twists();
  RelativeTwists relative(twists);
  for (LocalContact& contact : contacts) {
    const bool was_impending = contact.now.state == ContactState::kImpending;
    locate(contact, frames[contact.frame_a].X_W, frames[contact.frame_b].X_W);
    const Vector3 arm = contact.now.p_W - frames.reference_W();
    contact.now.v_n =
        contact.now.n_W.dot(point_velocity(relative.of(contact), arm) - contact.constraint.v_WC);
    if (contact.now.s > 0) {
      contact.now.state = ContactState::kImpending;
    } else if (contact.now.v_n > 0) {
      contact.now.state = ContactState::kSeparating;
    } else {
      contact.now.state = was_impending ? ContactState::kColliding : ContactState::kPenetrating;
    }
  }
}

Unknowns apply_contact_forces(const ContactGroup& group, const FrameMotions& frames,
                              const Unknowns& x) noexcept {
  if (group.contacts.empty()) return Unknowns::Zero(frames.unknowns());
  const ContactLaw& law = group.law;
  const FrameTwists twists = frames.twists(x);
  RelativeTwists relative(twists);
  FrameLoads loads(frames);
  for (LocalContact& contact : group.contacts) {
    const bool implicit = law.step == ContactStep::kImplicit;
    contact.latest.taken = implicit ? 0 : taken_since(contact, law);
    contact.latest.f_W.setZero();
    contact.latest.loaded = false;
    if (!takes_part(contact, law)) {
      contact.friction.z_W.setZero();
      contact.friction.slipping = false;
      continue;
    }
    const Vector3 arm = contact.now.p_W - frames.reference_W();
    const RelativeVelocity v = relative_velocity(contact, relative.of(contact), arm);
    const ContactForce f = force_at(contact, v, law);
    contact.friction.slipping = f.slips;
    // Backward Euler of the elasto-plastic anchor: exact in stick, and in slip it follows.
    contact.friction.z_W = (-law.dt * f.friction + law.damping * contact.friction.z_W) /
                           (law.stiffness * law.dt + law.damping);
    contact.latest.loaded = f.normal > 0;
    // The damper takes no more than the whole normal force does, under a cap for instance.
    if (implicit) {
      contact.latest.taken =
          law.dt * std::min(law.damping * v.normal * v.normal, f.normal * std::abs(v.normal));
    }
    contact.latest.f_W = f.normal * contact.now.n_W + f.friction;
    loads.add(contact, arm, contact.latest.f_W);
  }
  return loads.generalised();
}

StepSystem unit_system(const FrameMotions& frames) noexcept {
  StepSystem system;
  system.E.setIdentity(frames.unknowns(), frames.unknowns());
  system.r.setZero(frames.unknowns());
  return system;
}

}  // namespace hlm::server
