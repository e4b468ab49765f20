// Triangle meshes from files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "hlm/geometry/mesh.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

struct MeshSource {
  std::filesystem::path file;
  std::string submesh;     ///< Name of the part to use; empty: all.
  bool center = false;     ///< Whether the part is moved so that its bounding box is centred.
  Vector3 scale{1, 1, 1};  ///< Scale of the file's coordinates along x, y, z; not 0.
};

/// Reads a file of any format that assimp knows, and repairs it (repaired()). Throws
/// std::runtime_error with one line that names the file if it cannot be read.
Mesh read_mesh(const MeshSource& source, std::vector<std::string>& repairs);

}  // namespace hlm::ve
