// The signed distance of two convex shapes between two bounds that prove it, without a line of the
// code under test.
#pragma once

#include "tests/geometry/reference.h"

namespace hlm::geometry::test {

/// The signed distance s of two shapes: lower <= s <= upper.
struct DistanceBounds {
  double lower = 0;                ///< m.
  double upper = 0;                ///< m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit, body to tool: the gap along it is `lower`.

  double width() const { return upper - lower; }
};

/// Shapes that are apart: by the point of least norm of their difference (Wolfe 1976). Shapes that
/// overlap: by branch and bound over all normals, so that the least of several depths is found. The
/// bounds are within a tenth of a micrometre of each other, except where the search is given up.
DistanceBounds signed_distance(const Placed& tool, const Placed& body);

}  // namespace hlm::geometry::test
