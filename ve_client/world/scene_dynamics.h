// What a server must know of the world's bodies to move them while the hand holds them.
#pragma once

#include "hlm/protocol/scene_offer.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// Adds inertias and joints of the movable bodies that a server can move: what joints connect is a
/// tree of hinges and slides, small enough, that does not hang on the tool.
void add_dynamics(const World& world, protocol::SceneOffer& scene);

}  // namespace hlm::ve
