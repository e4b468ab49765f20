// Convex pieces of meshes that were made before, in the user's cache directory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

/// Most that is kept, bytes; what was not used for longest goes first. A mesh of 5000 triangles
/// takes some 200 kB.
inline constexpr std::uintmax_t kMostKept = 100'000'000;

/// The file for a mesh that is decomposed with these parameters, in
/// $XDG_CACHE_HOME/haptic_local_model, or ~/.cache/haptic_local_model. Empty if there is neither.
std::filesystem::path kept_file(const Mesh& mesh, std::span<const double> parameters);

/// What is kept in a file; empty if it is not there, or damaged.
std::optional<std::vector<Hull>> read_kept(const std::filesystem::path& file);

/// Best effort: what cannot be kept is computed again. Nobody reads half of it. Then `most` bytes
/// are kept in its folder.
void keep(const std::filesystem::path& file, const std::vector<Hull>& hulls,
          std::uintmax_t most = kMostKept);

}  // namespace hlm::ve
