// Triangle meshes, checked and repaired.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::geometry {

/// Most triangles of a mesh of which each can become a piece,
inline constexpr std::size_t kMostTriangles = 50'000;
/// and of one that becomes solids: a million take some 3 s and 0.4 GB.
inline constexpr std::size_t kMostOfSolids = 1'000'000;

/// Triangles, counter-clockwise seen from outside.
struct Mesh {
  std::vector<Vector3> points;  ///< m; each is at least one triangle's corner.
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::vector<std::size_t>> around;  ///< The triangles at each point.
  bool closed = false;  ///< Every edge joins two triangles: the mesh has an inside.
  /// A mesh with a border is the front of a thin sheet; its back has the same triangles, turned.
  std::shared_ptr<const Mesh> back;
  const Mesh* sheet = nullptr;  ///< Of front and back the back.

  bool is_sheet() const { return sheet != nullptr; }
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

/// Corners at the same place become one, triangles without area are left out, triangles are turned
/// to agree with their neighbours, and a closed mesh that is inside out is turned: `repairs` says
/// what was done, one line each, which begins with "mesh" and `name`. Throws std::runtime_error
/// with one such line if a coordinate is not finite or larger than 1 km, or there are no or more
/// than `most` triangles.
Mesh repaired(Mesh mesh, const std::string& name, std::vector<std::string>& repairs,
              std::size_t most = kMostTriangles);

}  // namespace hlm::geometry
