// How strong the friction of a body's own contacts is in the environment, as its motion shows
// (docs/method.md 11). Engines that approximate the friction cone differ from their coefficients by
// up to 40 %.
#pragma once

#include "common/contact.h"
#include "haptic_server/local_model/local_body.h"
#include "haptic_server/local_model/local_contact.h"

namespace hlm::server {

/// Takes over from `known` what is known of the friction of the same bodies, and scales that of
/// their contacts with it. kinetic_friction: of contacts without a coefficient of their own.
/// first_frame: of bodies[0].
void scale_friction(LocalBodies& bodies, const LocalBodies& known, FrameIndex first_frame,
                    double kinetic_friction, LocalContacts& contacts) noexcept;

/// Revises friction_scale of a body that slid while it was reported, at V_W, from the correction of
/// its velocity: what it was wrong by over one frame. ahead: on friction in the steps between
/// updates. contacts: as reported. period: of the environment's frames, s. late: by which the
/// report is behind the local model, s.
void learn_friction(LocalBody& body, const Twist& V_W, const ReportedContacts& contacts,
                    double kinetic_friction, double ahead, double period, double late) noexcept;

}  // namespace hlm::server
