// The shapes of a world as a server takes them, so that it finds their contacts itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::protocol {

/// A shape of the world, of a link of the tool or of a body.
struct OfferedShape {
  SceneShape shape = {};
  ContactSide side = {};
  Pose X_BS = {};                   ///< In the frame of its link or body, or in the world.
  Friction friction = {};           ///< Negative: the server's own.
  std::uint32_t group = 1;          ///< Two may touch if a bit of one's group is in the other's
  std::uint32_t mask = 0xffffffff;  ///< mask. Those of one link or body never do.
};

/// All shapes of a scene.
struct SceneOffer {
  std::vector<OfferedShape> shapes = {};
  /// Places of those that never touch.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> apart = {};
  /// Of bodies that the server may move while the hand holds them; others are walls that move.
  std::vector<BodyInertia> inertias = {};
  /// Which of them hang on another one, or on the world; others are free.
  std::vector<BodyJoint> joints = {};
};

/// What a stream has brought before.
struct OfferedBefore {
  std::uint32_t scene = 0;              ///< Number of its latest scene; 0: none.
  std::size_t shapes = 0;               ///< Placements in that.
  std::set<std::uint64_t> hashes = {};  ///< Of their shapes.
};

/// Records that make it the next scene, with inertias if the server takes them, in which a shape's
/// placement has its place in the list as id, and bring `before` up to date. tool_links: how many
/// the tool has. Throws std::invalid_argument that names the shape, its value and what is allowed;
/// `before` is as it was then.
std::vector<std::uint8_t> scene_of(const SceneOffer& offer, std::size_t tool_links,
                                   OfferedBefore& before, bool inertias = false);

}  // namespace hlm::protocol
