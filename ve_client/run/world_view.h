// What a page is shown of a simulated world.
#pragma once

#include <string>
#include <vector>

#include "hlm/client/haptic_client.h"
#include "hlm/page/page_messages.h"
#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/scene/scene.h"

namespace hlm::ve {

struct WorldView {
  const VirtualEnvironment& environment;
  const Scene& scene;                       ///< What is played,
  const std::vector<SceneSummary>& scenes;  ///< and what may be, this one included.
  const std::string& start;  ///< One of its starts; empty: where the world places it.
  const protocol::Welcome* welcome = nullptr;  ///< Null before the server has answered.
};
/// As it begins, with the first of its tools.
PageWorld page_world(const WorldView& view);

/// What is the world's of a frame that has ended.
PageFrame page_frame(const VirtualEnvironment& environment, const HapticClient& client,
                     const FrameResult& result);

}  // namespace hlm::ve
