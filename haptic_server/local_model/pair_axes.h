// Which separating axis of each pair of convex pieces acts in a step (docs/method.md 2.8)?
#pragma once

#include "hlm/local_model/contact_update.h"

namespace hlm::server {

/// Decides from their gaps which axis of each pair acts; one that acts so far stays unless another
/// is better by kAxisAdvantage. True if any is another one than before.
bool decide_axes(PairAxes& axes) noexcept;

/// Lets another axis of a pair act if its gap is greater, or if it stays open in this step of dt
/// seconds while the one that acts closes. Its contacts are then new ones, deformed by the update
/// rule; the load of those before is released as that of contacts that are no longer reported.
/// contacts: those that act have been evaluated for the step that begins.
void choose_axes(ToolContacts& contacts, const FrameMotions& frames, const UpdatePolicy& policy,
                 double dt) noexcept;

}  // namespace hlm::server
