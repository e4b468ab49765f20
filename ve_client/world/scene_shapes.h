// The shapes of a world for a server that finds their contacts itself (docs/method.md 18).
#pragma once

#include "hlm/common/contact.h"
#include "hlm/protocol/scene_offer.h"
#include "hlm/ve_client/world/virtual_tool.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// The shapes of the world with this tool. Bodies and links are named as in contacts. friction: the
/// shapes carry that of their materials where the world states it. Shapes of other tools are left
/// out.
protocol::SceneOffer scene_of(const World& world, const ToolAssembly& tool, bool friction);

/// Where the movable bodies are, and how they move; of more than kMaxPoses those whose surroundings
/// are nearest to the tool. kept: no server may move them.
BodyPoses body_poses(const World& world, const VirtualTool& tool, bool kept);

}  // namespace hlm::ve
