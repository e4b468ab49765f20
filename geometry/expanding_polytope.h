// How deep do cores overlap, and along which normal?
#pragma once

#include <optional>

#include "hlm/geometry/core_separation.h"

namespace hlm::geometry {

/// The normal with the largest gap between cores that overlap or touch, by the expanding polytope
/// algorithm (van den Bergen 2001): a polytope inside the Minkowski difference grows where its
/// surface is nearest the origin. `gap` is that of the normal; `upper` is what the polytope proves
/// if it contains the origin, else `touching_upper` (m, from closest_points()). Ends once the two
/// differ by `tolerance` (m, >= 0); of cores with flat faces the answer is exact to rounding.
///
/// Bounded, never allocates. None if the Minkowski difference is flat, or if rounding stops the
/// growth: then `toward`, any direction to begin with, may be changed. Sets `too_long` to
/// whether it gave up a pair that overlaps more deeply than is promised.
std::optional<CoreSeparation> expanding_polytope(const CorePair& pair, const Vector3& toward,
                                                 double tolerance, double touching_upper,
                                                 bool& too_long) noexcept;

}  // namespace hlm::geometry
