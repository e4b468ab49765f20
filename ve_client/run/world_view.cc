#include "hlm/ve_client/run/world_view.h"

#include <utility>

namespace hlm::ve {
namespace {

PageBody page_body(const BodyDescription& body, bool is_tool) {
  PageBody shown{.name = body.name, .fixed = body.fixed, .is_tool = is_tool, .X_WB = body.X_WB};
  const Mesh* latest = nullptr;
  for (const CollisionDescription& collision : body.collisions) {
    const Mesh* const mesh = collision.mesh.get();
    if (mesh != nullptr && mesh == latest) continue;  // The pieces of a skin are shown as one.
    latest = mesh;
    PageShape& shape = shown.shapes.emplace_back(PageShape{collision.shape, collision.X_BG});
    if (mesh != nullptr) shape.geometry = collision.mesh;
  }
  return shown;
}

}  // namespace

PageWorld page_world(const WorldView& view) {
  const ToolAssembly& assembly = view.environment.tools.front().assembly;
  PageWorld world;
  const auto& bodies = view.environment.world.description().bodies;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    world.bodies.push_back(
        page_body(bodies[static_cast<std::size_t>(i)], view.environment.world.is_tool(i)));
  }
  world.tool = {assembly.description, assembly.q, assembly.bodies, assembly.X_LB,
                !assembly.drives.empty()};
  world.scene = scene_name(view.scene.file);
  world.scenes = view.scenes;
  for (const StartDescription& start :
       find_model(view.scene.world, view.scene.tools.front()).starts) {
    world.starts.push_back(start.name);
  }
  world.start = view.start;
  world.welcome = view.welcome;
  return world;
}

PageFrame page_frame(const VirtualEnvironment& environment, const HapticClient& client,
                     const FrameResult& result) {
  PageFrame frame;
  const auto& described = environment.world.description().bodies;
  for (int i = 0; i < static_cast<int>(described.size()); ++i) {
    if (!described[static_cast<std::size_t>(i)].fixed) {
      frame.X_WB.push_back(environment.world.X_WB(i));
    }
  }
  frame.connected = client.connected();
  frame.round_trip = client.round_trip();
  frame.state = result.inbox.state;
  frame.reported = result.active + result.predicted;
  frame.epsilon = result.epsilon;
  frame.world_time = environment.pace.time();
  return frame;
}

}  // namespace hlm::ve
