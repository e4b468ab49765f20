// Makes a scene of a commit: the long part of the loader's work.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "hlm/common/tool_description.h"
#include "hlm/haptic_server/scene/scene.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::server {

/// A commit with all that a scene is made of; nothing of it changes.
struct SceneOrder {
  std::uint64_t session = 0;
  ToolDescription tool;
  std::uint32_t number = 0;
  std::vector<protocol::ScenePlacement> placements;
  std::vector<protocol::SceneApart> apart;
  std::vector<BodyInertia> inertias;
  std::vector<BodyJoint> joints;
  std::map<std::uint64_t, std::shared_ptr<const protocol::SceneShape>> shapes;  ///< By hash.
};

struct MadeScene {
  std::uint64_t session = 0;
  std::uint32_t number = 0;
  std::unique_ptr<Scene> scene;
};

/// Either a scene, or why there can be none.
struct SceneOutcome {
  std::uint64_t session = 0;
  std::unique_ptr<MadeScene> made;
  std::optional<protocol::SceneFault> fault;
};

/// Keeps what it has made of shapes as long as a scene of the session has them.
class SceneMaker {
 public:
  /// Pieces of one scene: each triangle of a mesh that moves is one. More take the loader's time
  /// and memory, some 5 kB each.
  static constexpr std::size_t kMostPieces = 60'000;
  /// Triangles of all meshes of the world, some 180 bytes each.
  static constexpr std::size_t kMostTriangles = 2'000'000;

  /// Asks interruption_point() on the way, which alone can end it by an exception.
  SceneOutcome make(const SceneOrder& order);

 private:
  using Parts = std::shared_ptr<const geometry::ShapeParts>;

  std::unique_ptr<Scene> scene_of(const SceneOrder& order);
  const Parts& parts_of(const SceneOrder& order, const protocol::ScenePlacement& placement);

  std::uint64_t session_ = 0;
  std::map<std::pair<std::uint64_t, geometry::MeshUse>, Parts> parts_;  ///< By shape.
};

}  // namespace hlm::server
