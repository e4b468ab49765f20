// Triangle meshes from files, checked and repaired.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::ve {

/// Most triangles of a mesh. Each can become a piece of the world.
inline constexpr std::size_t kMostTriangles = 20000;

/// Triangles, counter-clockwise seen from outside.
struct Mesh {
  std::vector<Vector3> points;  ///< m; each is at least one triangle's corner.
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::vector<std::size_t>> around;  ///< The triangles at each point.
  bool closed = false;  ///< Every edge joins two triangles: the mesh has an inside.

  Vector3 corner(std::size_t triangle, std::size_t i) const {
    return points[static_cast<std::size_t>(triangles[triangle][i])];
  }
  /// Normal of a triangle with twice its area as length, m².
  Vector3 area(std::size_t triangle) const;
  /// What it encloses, m³, if it is closed.
  double volume() const;
  /// Sets `around` by the triangles.
  void find_around();
};

struct MeshSource {
  std::filesystem::path file;
  std::string submesh;     ///< Name of the part to use; empty: all.
  bool center = false;     ///< Whether the part is moved so that its bounding box is centred.
  Vector3 scale{1, 1, 1};  ///< Scale of the file's coordinates along x, y, z; not 0.
};

/// Reads a file of any format that assimp knows. Corners at the same place become one, triangles
/// without area are left out, triangles are turned to agree with their neighbours, and a closed
/// mesh that is inside out is turned: `repairs` says what was done, one line each, which names the
/// file. Throws std::runtime_error with one line that does so if the file cannot be read, a
/// coordinate is not finite or larger than 1 km, or there are no or more than kMostTriangles
/// triangles.
Mesh read_mesh(const MeshSource& source, std::vector<std::string>& repairs);

/// The same for triangles from elsewhere; `name` names them.
Mesh repaired(Mesh mesh, const std::string& name, std::vector<std::string>& repairs);

}  // namespace hlm::ve
