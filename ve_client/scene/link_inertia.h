// Mass, centre of mass and inertia of a link that moves.
#pragma once

#include <optional>

#include <sdf/Link.hh>

#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/solid.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// Gives the body mass and inertia of the link. What the file does not say, or what no body of
/// these shapes can have, is taken from `solid_B`, all the link's shapes, and approximated; without
/// shapes it is as SDFormat has it, or refused. The body's frame moves with its centre of mass, and
/// the collisions stay where they are.
void read_inertia(const sdf::Link& link, const std::optional<Solid>& solid_B, BodyDescription& body,
                  Diagnostics& diagnostics);

}  // namespace hlm::ve
