// Independent answers to compare contact detection with: closed-form projections of shapes, and the
// signed distance of two boxes by enumeration.
#pragma once

#include "hlm/geometry/manifold.h"
#include "tests/support/random.h"

namespace hlm::geometry::test {

using hlm::test::Random;

/// A shape and where it is.
struct Placed {
  Shape shape;
  Pose X_WS;
};

/// Largest coordinate of the shape (not a half-space) along the unit vector n_W, m.
double extent_along(const Placed& placed, const Vector3& n_W);
/// Gap between the shapes along the unit normal n_W from the body to the tool, m.
double gap_along(const Placed& tool, const Placed& body, const Vector3& n_W);
/// Largest gap that a search finds among directions from everywhere, and then near the best of
/// them and near n_W, m. Never larger than the true separation.
double largest_gap(const Placed& tool, const Placed& body, const Vector3& n_W, Random& random);

/// Signed distance of two boxes, m: every vertex against the other box and every edge against every
/// edge if they are apart, all 15 axes if they overlap.
double box_separation(const Box& a, const Pose& X_WA, const Box& b, const Pose& X_WB);

/// Signed distance of the point p_W from the surface of the shape, m, negative inside.
double distance_to_surface(const Placed& placed, const Vector3& p_W);

/// Signed distance of two hulls, m: that of the origin from the hull of all differences of their
/// points.
double hull_separation(const Hull& a, const Pose& X_WA, const Hull& b, const Pose& X_WB);

/// A shape of the kind: 0 sphere, 1 capsule, 2 cylinder, 3 box, 4 ellipsoid, 5 hull; sizes of 10 to
/// 100 mm.
inline constexpr int kShapeKinds = 6;
Shape random_shape(int kind, Random& random);
/// Points on an ellipsoid of 10 to 100 mm.
Hull random_hull(int vertices, Random& random);

/// How the tool is turned relative to the body.
enum class Turn { kAny, kParallel, kNearlyParallel, kAboutOneAxis };
inline constexpr Turn kTurns[] = {Turn::kAny, Turn::kParallel, Turn::kNearlyParallel,
                                  Turn::kAboutOneAxis};
Quaternion random_turn(Turn turn, Random& random);

/// The contacts of the pair.
Manifold contacts_of(const Placed& tool, const Placed& body, double epsilon,
                     ProximityStatistics& statistics);
/// The same; requires that the answer was not refused.
Manifold contacts_of(const Placed& tool, const Placed& body, double epsilon);

/// Smallest separation of the contacts, m; +infinity if there are none.
double smallest_separation(const Manifold& manifold);
bool has_unique_keys(const Manifold& manifold);

}  // namespace hlm::geometry::test
