// Every tolerance of the narrow phase: distance, penetration, manifolds, hulls. Each with its unit,
// its usual value, and what goes wrong with another.
#pragma once

#include <numbers>

namespace hlm::geometry::narrow {

// What is promised.

/// m. Largest difference between the bounds of a signed distance that is believed; nearer cores
/// count as touching; and a point this near to a corner or a border belongs to that. Larger:
/// separations are off by as much, and small features swallow their neighbours. Smaller: answers
/// are refused where rounding leaves their bounds farther apart, and contacts on common borders
/// change their names.
inline constexpr double kAccuracy = 1e-6;
/// m. A contact this near to the smallest separation stands for it; a tenth of what is promised.
/// Larger: the deepest contact is too shallow by as much. Smaller: the nearest points are listed
/// besides a corner that is the same place.
inline constexpr double kRepresents = kAccuracy / 10;

/// m. Depth of the cores to which separations are promised; of a deeper pair that has a circle of
/// equally good normals none is proved. Larger: such a pair takes 20 ms instead of 3.4. Smaller:
/// cylinders that lie in each other side by side are refused at a depth that occurs.
inline constexpr double kDeepest = 0.02;

// Rounding.

/// m. Rounding of lengths: of coordinates of a metre 1e-16, of 30 m some 1e-14, several times over.
/// Bounds this close are one, and so are a point and a plane. Larger: normals of curved cores are
/// less exact, by 3e-6 rad for 1e-13 at 20 mm radius. Smaller: searches go on in noise, and
/// polytopes get slivers.
inline constexpr double kLength = 1e-13;
/// rad. Rounding of directions: with a smaller sine between them they are parallel and have no
/// cross product, and unit vectors that differ by less are one. Larger: axes of edges that cross by
/// less are not tried. Smaller: cross products are noise.
inline constexpr double kDirection = 1e-9;
/// rad. The same for what is given as parallel: edges of a box, three points on a line. Larger: a
/// triangle of 30 m with a side of a micrometre is left to its sides. Smaller: one along a line has
/// weights that are noise.
inline constexpr double kLine = 1e-12;
/// m. A later candidate for the best normal has to be better by more. Larger: depths are off by as
/// much. Smaller: a face's normal gives way to cross products of edges that tie with it, and
/// changes with rounding. A thinner difference of two cores has no inside to grow a polytope in.
inline constexpr double kAdvantage = 1e-9;
/// m². Twice the area of the smallest face of such a polytope. Larger: pairs of shapes of
/// micrometres are refused. Smaller: normals of faces are noise.
inline constexpr double kSmallestArea = 1e-22;

// Nearest points and penetration.

/// m. Gap to which overlapping cores are moved apart to find their normal. Larger: what is left of
/// the normal's error is this, and the depth, of the radius of curvature. Smaller: rounding turns
/// the normal, 1e-12 rad at this value.
inline constexpr double kMovedApart = 1e-4;
/// m. Bounds of the distance of curved cores at which Newton's method takes over. Larger: it fails
/// at times, and costs as much as three steps of the search. Smaller: more steps of the search; two
/// cylinders take 14 with 1e-5, and 39 without.
inline constexpr double kNewtonFrom = 1e-4;
/// Share of the bounds' difference after which it is tried again. Larger: it is tried in vain more
/// often. Smaller: later than it could succeed.
inline constexpr double kNewtonAgain = 1e-2;
/// m. Difference between the bounds of the expanding polytope at which curved cores are done: half
/// of what is believed. Larger: answers are refused. Smaller: it takes more points.
inline constexpr double kCurved = kAccuracy / 2;
/// rad. A step that makes the normal of an overlap more exact and turns it by less is the last.
/// Larger: the normal turns from pose to pose, and contacts flicker between names. Smaller: one
/// more step, of 1 µs.
inline constexpr double kPolished = 1e-5;
/// Cosine between a normal of a cylinder's side and its axis that counts as 0. Larger: normals of
/// the rim are tried as normals of the side, in vain. Smaller: those of the side stay as inexact as
/// the search leaves them.
inline constexpr double kSideways = 1e-3;
/// Cosine of 1 mrad: a normal that features give and that is farther from the search's is another.
/// Larger cosine: fewer normals are made exact. Smaller: the normal of another feature may be
/// taken, though only with a gap as large.
inline constexpr double kSameNormal = 1 - 5e-7;
/// Cosine of 30°: two normals of a pair that are on one side of it. Larger: the side of a thin body
/// on which the tool is gets lost as it turns. Smaller: a normal is kept that has long become
/// wrong.
inline constexpr double kSameSide = std::numbers::sqrt3 / 2;

// Manifolds.

/// rad. Two axes of a pair are one: what a search for nearest points leaves. Larger: a curved
/// pair's best axis gives way to a face's that is worse by this times its size. Smaller: the same
/// axis is listed twice.
inline constexpr double kSameAxis = 1e-4;
/// In ε: how much nearer to the best an axis comes while the tool moves by ε, for its gap may grow
/// by ε and that of the best shrink by as much. Larger: axes are sent in vain. Smaller: some are
/// missed.
inline constexpr double kReach = 2;
/// rad. Sharp edges with a smaller sine between them touch along a line: its ends, 0.1 m apart,
/// then part by 0.1 mm. Larger: points of one edge lie as much beside the other. Smaller: a box on
/// an edge rocks on one contact.
inline constexpr double kParallelEdges = 1e-3;
/// rad. The same for capsules and lines of cylinders, where a place beside the edge differs little:
/// by 0.1 mm at the ends of 0.1 m and 20 mm radius. Larger: by more. Smaller: such a pair rocks on
/// one contact.
inline constexpr double kParallelRoundEdges = 25e-3;
/// rad. A cap that leans by less is flat, and its lowest point where rounding puts it. Larger: a
/// rim that rolls loses its contact at each of its corners. Smaller: a flat cap has a contact that
/// jumps about its rim.
inline constexpr double kLeans = 1e-3;

// Hulls.

/// m. Facets whose corners lie this near to one plane are one face. Larger: faces are off by as
/// much. Smaller: rounding of meshes in single precision, 1e-8 m for 0.1 m, breaks faces up.
inline constexpr double kCoplanar = 1e-7;
/// m. A thinner hull has no inside. Larger: thin parts are refused. Smaller: normals of its faces
/// are noise.
inline constexpr double kThinnest = 1e-6;

}  // namespace hlm::geometry::narrow
