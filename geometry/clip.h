// Where do two patches lie over each other, seen along the normal of a contact, and which features
// meet there?
#pragma once

#include "hlm/geometry/convex.h"

namespace hlm::geometry {

/// A corner of the overlap of two patches: a point of each, on one line along the normal.
struct Opposite {
  Vector3 p_first = Vector3::Zero();   ///< Point on the first patch, m.
  Vector3 p_second = Vector3::Zero();  ///< Point on the second patch, m.
  Feature first;                       ///< The feature of the first patch that is met there.
  Feature second;                      ///< Feature of the second.
};
/// Most corners of an overlap that are given: of two round faces a part spread over them.
inline constexpr std::size_t kMaxOpposites = 24;
using Opposites = StaticVector<Opposite, 2 * kMaxFaceCorners>;

/// Corners of the overlap of `incident` (face, edge or vertex; the first patch) with the face
/// `reference` (the second), projected along the unit vector n, all in one frame. A corner is one
/// of the incident patch (vertex, face), one of the reference (face, vertex), or a crossing (edge,
/// edge): the same set if the two faces change places. No feature pair occurs twice. Of more than
/// kMaxOpposites the crossings stay, and of the vertices those with the lowest numbers: which ones
/// does not change while the same ones are there.
Opposites overlap(const Patch& incident, const Patch& reference, const Vector3& n);

/// Ends of the overlap of two edges that are parallel: (vertex, edge) or (edge, vertex). None if
/// either patch is not an edge or they are not parallel (to 1 mrad, two round ones to 25).
Opposites overlap_of_edges(const Patch& first, const Patch& second);

}  // namespace hlm::geometry
