// The convex hull of points, with coplanar facets merged into faces.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::geometry {

/// Most vertices of a hull. Its edges, at most three for each, are numbered with 16 bits.
inline constexpr std::size_t kMaxHullVertices = 4096;

/// Vertices and faces of a convex polytope.
struct HullFaces {
  /// m. In an order of their own: each is the one farthest from all before it, so that the first
  /// few are spread over the hull.
  std::vector<Vector3> vertices;
  /// Corners of each face, counter-clockwise seen from outside.
  std::vector<std::vector<std::uint16_t>> loops;
  /// Outward unit normals, as `loops`.
  std::vector<Vector3> normals;
  /// The vertices that share an edge of the hull's triangulation with each vertex.
  std::vector<std::vector<std::uint16_t>> neighbours;
};

/// Whether convex_hull() finds a hull that is thicker than 1 µm.
bool has_inside(std::span<const Vector3> points);

/// The hull of at least four points (m) by Qhull (Barber, Dobkin, Huhdanpaa 1996). The same points
/// in any order give the same vertices and faces except for ties. Throws std::invalid_argument with
/// one line if a coordinate is not finite or larger than 1 km, if the points lie in a plane (the
/// hull is thinner than 1 µm), or if the hull has more than kMaxHullVertices.
HullFaces convex_hull(std::span<const Vector3> points);

}  // namespace hlm::geometry
