// A shape where it belongs.
#pragma once

#include <cstdint>
#include <memory>

#include "hlm/common/contact.h"
#include "hlm/geometry/shape_parts.h"

namespace hlm::server {

/// In the world, or on a link of the tool or a body.
struct PlacedShape {
  std::shared_ptr<const geometry::ShapeParts> shape;
  ContactSide side;
  Pose X_BS;                        ///< In the frame of its link or body, or in the world.
  Friction friction = {};           ///< Of its material; if it does not say, the local model's.
  std::uint32_t group = 1;          ///< Two shapes may touch if a bit of one's group is in the
  std::uint32_t mask = 0xffffffff;  ///< other's mask. Those of one side never do.
};

}  // namespace hlm::server
