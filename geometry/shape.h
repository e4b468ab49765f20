// Collision shapes. Each convex one is a core swept by a sphere of radius `margin()`: sphere =
// point, capsule = segment, the others have margin 0.
#pragma once

#include <variant>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::geometry {

struct Sphere {
  double radius = 0;  ///< m, > 0.
};
/// Along z of its frame, centred.
struct Capsule {
  double radius = 0;  ///< m, > 0.
  double length = 0;  ///< Length of the cylindrical part, m, > 0.
};
/// Along z of its frame, centred.
struct Cylinder {
  double radius = 0;  ///< m, > 0.
  double length = 0;  ///< m, > 0.
};
/// Centred.
struct Box {
  Vector3 size = Vector3::Zero();  ///< Edge lengths, m, each > 0.
};
/// Centred.
struct Ellipsoid {
  Vector3 radii = Vector3::Zero();  ///< Semi-axes along x, y, z of its frame, m, each > 0.
};
/// The convex hull of points.
struct Hull {
  std::vector<Vector3> vertices;  ///< m; those inside the hull do no harm.
};
/// Half-space z <= 0 of its frame; its outward normal is +z. Environment only.
struct HalfSpace {};

using Shape = std::variant<Sphere, Capsule, Cylinder, Box, Ellipsoid, Hull, HalfSpace>;

}  // namespace hlm::geometry
