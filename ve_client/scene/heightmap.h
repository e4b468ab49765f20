// Terrain from images of its heights.
#pragma once

#include <filesystem>

#include "hlm/geometry/mesh.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

/// Most heights along a side. Each four neighbours are two triangles, each of which becomes a piece
/// of the world: 129 x 129 take a second and 0.17 GB. More than 140 do not fit into a message to
/// the live page; 257 take five seconds and 0.66 GB.
inline constexpr std::size_t kMostHeightsAlong = 129;

/// The triangles between the heights of a PNG image (read_grey_png()), as Gazebo places them: black
/// is at z = 0 and the brightest pixel at size.z; the image's middle is at x = y = 0, its right
/// side at size.x / 2, its top at size.y / 2 (m, all > 0). Each four heights are parted from the
/// lower left to the upper right one. Throws as read_grey_png().
Mesh read_heightmap(const std::filesystem::path& file, const Vector3& size);

}  // namespace hlm::ve
