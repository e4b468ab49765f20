// The shapes of a world as a server takes them, so that it finds their contacts itself.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::protocol {

/// A shape of the world, of a link of the tool or of a body.
struct OfferedShape {
  SceneShape shape;
  ContactSide side;
  Pose X_BS;                        ///< In the frame of its link or body, or in the world.
  double friction = -1;             ///< Coefficient, of two the smaller; negative: the server's.
  std::uint32_t group = 1;          ///< Two may touch if a bit of one's group is in the other's
  std::uint32_t mask = 0xffffffff;  ///< mask. Those of one link or body never do.
};

/// What HapticClient::offer_scene() takes: records that make scene 1, in which a shape is named by
/// its place in the list. apart: places of those that never touch. tool_links: how many the tool
/// has. Throws std::invalid_argument that names the shape, its value and what is allowed.
std::vector<std::uint8_t> scene_of(std::span<const OfferedShape> shapes,
                                   std::span<const std::pair<std::uint32_t, std::uint32_t>> apart,
                                   std::size_t tool_links);

}  // namespace hlm::protocol
