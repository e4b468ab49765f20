// How strong the friction of a body's own contacts is in the environment, as its motion shows
// (docs/method.md 11). Engines that approximate the friction cone differ from their coefficients by
// up to 40 %.
#pragma once

#include "hlm/common/contact.h"
#include "hlm/haptic_server/local_model/local_body.h"
#include "hlm/haptic_server/local_model/local_contact.h"

namespace hlm::server {

/// Takes over from `known` what is known of the friction of the same bodies, and scales that of
/// their contacts with what does not move with the tool. first_frame: of bodies[0].
void scale_friction(LocalBodies& bodies, const LocalBodies& known, FrameIndex first_frame,
                    LocalContacts& contacts) noexcept;

/// What is learnt from, besides the body's correction.
struct FrictionReport {
  const ReportedContacts& contacts;
  double kinetic_friction;  ///< μ_k of contacts without a coefficient of their own.
  double ahead;             ///< Factor on friction in the steps between updates.
  double elapsed;           ///< Time since the state that the update before was about, s.
  double late;              ///< Time by which the state is behind the local model, s.
};

/// Revises friction_scale of a body from the correction of its velocity, if all its loaded contacts
/// slide on what does not move with the tool. V_W: of the body as reported.
void learn_friction(LocalBody& body, const Pose& X_WB, const Twist& V_W,
                    const FrictionReport& report) noexcept;

}  // namespace hlm::server
