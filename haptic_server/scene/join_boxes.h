// Boxes that are one box together: tiles, bricks, voxels.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "hlm/haptic_server/scene/placed_shape.h"

namespace hlm::server {

/// Boxes of one side, orientation, friction and group that share a whole face, or overlap along one
/// axis, become one box, in the place of the first of them; the others lose their shape. What is in
/// `apart`, pairs of places, stays as it is. A tool meets one surface then, without seams, in the
/// time of one shape.
void join_boxes(std::span<PlacedShape> shapes,
                std::span<const std::pair<std::uint32_t, std::uint32_t>> apart);

}  // namespace hlm::server
