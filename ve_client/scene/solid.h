// What shapes weigh: their volume, its centre and its moments.
#pragma once

#include <optional>

#include "hlm/common/spatial.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

/// A volume that is filled evenly.
struct Solid {
  double volume = 0;                 ///< m³, > 0.
  Vector3 centre = Vector3::Zero();  ///< Its centre of mass, m.
  /// Moments and products of inertia about the centre for each kg/m³: m⁵.
  Matrix3 moments = Matrix3::Zero();
};

/// Of a shape, in its frame; empty for a half-space. A hull thinner than 1 µm counts as its
/// bounding box.
std::optional<Solid> solid_of(const Shape& shape);

/// What a closed mesh encloses. One that is open, or whose parts are not turned alike, counts as
/// its bounding box, each side at least 1 mm.
Solid solid_of(const Mesh& mesh);

/// The same volume in A, where G is its frame.
Solid moved(const Pose& X_AG, const Solid& solid_G);

/// Both volumes. Where they overlap, both count.
Solid together(const Solid& a, const Solid& b);

}  // namespace hlm::ve
