// How far apart are two convex cores, and where are they nearest?
#pragma once

#include "hlm/geometry/core_pair.h"
#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {

/// Answer of closest_points(). The distance d of the cores satisfies lower <= d <= upper.
struct ClosestPoints {
  enum class Relation : std::uint8_t {
    kBeyond,    ///< Farther apart than asked; only `lower` holds.
    kSeparate,  ///< All members hold.
    kTouching,  ///< Nearer than narrow::kAccuracy or overlapping: `upper` holds, and n_B if it is
                ///< not 0.
  };
  Relation relation = Relation::kBeyond;
  double lower = 0;                  ///< Gap along n_B, m.
  double upper = 0;                  ///< Distance of the two points, m; 0 if the cores overlap.
  Vector3 n_B = Vector3::Zero();     ///< Unit, body to tool.
  Vector3 p_tool = Vector3::Zero();  ///< Point on the tool's core, in B, m.
  Vector3 p_body = Vector3::Zero();  ///< Point on the body's core, in B, m.
};

/// Gilbert, Johnson and Keerthi's algorithm. `beyond`, m, >= 0: stops early once the cores are
/// known to be farther apart. Bounded; never allocates. Neither shape may be a half-space.
ClosestPoints closest_points(const CorePair& pair, double beyond) noexcept;
/// The same, beginning in the direction v, not 0, from the body to the tool.
ClosestPoints closest_points(const CorePair& pair, double beyond, Vector3 v) noexcept;

/// The nearest points once the tool has been moved along the unit normal n_B until the gap there,
/// which is `gap` now, is narrow::kMovedApart. p_tool is given for the tool where it is. If n_B has
/// the largest gap of all normals, p_tool - p_body = gap n_B; else the n_B of the answer has a
/// larger one.
ClosestPoints closest_points_moved_apart(const CorePair& pair, const Vector3& n_B,
                                         double gap) noexcept;

}  // namespace hlm::geometry
