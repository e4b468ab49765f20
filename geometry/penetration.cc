#include "hlm/geometry/penetration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "hlm/geometry/ccd_penetration.h"
#include "hlm/geometry/expanding_polytope.h"
#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {
namespace {

/// Most steps by which the normal of curved cores is made more exact; two are usual. Each costs a
/// search for nearest points. With one, normals turn by 1e-4 rad from pose to pose.
constexpr int kMostPolishes = 4;
/// Where the expanding polytope starts, one attempt each, next to the line between the origins.
/// Some directions make a symmetrical pair yield slivers.
const std::array<Vector3, 2> kAskew = {Vector3(0.036, 0.048, 0.08), Vector3(0.048, -0.06, 0.064)};

/// rad. Where all starts fail, the tool is turned by these, one after the other: what is parallel
/// to 1e-9 makes slivers. Larger: proofs are worse by this times the tool's size, 1e-7 m for 0.2 m.
/// Smaller: it is as parallel as before.
constexpr std::array<double, 2> kAskewTurns = {1e-7, 5e-7};

/// Keeps the normal with the largest gap.
class BestNormal {
 public:
  explicit BestNormal(const CorePair& pair) : pair_(pair) {
    best_.gap = -std::numeric_limits<double>::infinity();
  }
  /// Only of normals within 30° of `near_B`, a unit vector.
  BestNormal(const CorePair& pair, const Vector3& near_B) : BestNormal(pair) { near_B_ = near_B; }

  void consider(const Vector3& n_B) {
    if (near_B_ && n_B.dot(*near_B_) < narrow::kSameSide) return;
    const double gap = pair_.gap(n_B);
    if (gap > best_.gap + narrow::kAdvantage) {
      best_.gap = gap;
      best_.n_B = n_B;
    }
  }
  /// Takes over what improves the gap at all.
  void refine(const Vector3& n_B) {
    const double gap = pair_.gap(n_B);
    if (!(gap > best_.gap)) return;
    best_.gap = gap;
    best_.n_B = n_B;
  }
  void consider_both(const Vector3& direction) {
    consider(direction);
    consider(-direction);
  }
  const CoreSeparation& best() const { return best_; }

 private:
  const CorePair& pair_;
  std::optional<Vector3> near_B_;
  CoreSeparation best_;
};

/// Cores without faces can have a Minkowski difference without volume; then any normal of it will
/// do.
void consider_perpendiculars(const CorePair& pair, BestNormal& best) {
  for (const Vector3& e_T : pair.tool.edge_directions()) {
    best.consider_both(pair.R_BT * e_T.unitOrthogonal());
  }
  for (const Vector3& f : pair.body.edge_directions()) best.consider_both(f.unitOrthogonal());
  best.consider(Vector3::UnitZ());
}

/// Climbs from a normal to better ones near it, as far as they get better: between faces and edges
/// of hulls that are not listed.
void consider_climb(const CorePair& pair, const Vector3& before_B, BestNormal& best) {
  constexpr int kSteps = 8;
  best.consider(before_B);
  for (int i = 0; i < kSteps && !best.best().n_B.isZero(0); ++i) {
    const double gap = best.best().gap;
    best.consider(closest_points_moved_apart(pair, best.best().n_B, gap).n_B);
    if (best.best().gap - gap < narrow::kAdvantage) return;
  }
}

/// True if one core is a point and the other a cylinder's.
bool is_point_in_cylinder(const CorePair& pair) {
  return (pair.tool.is_point() && pair.body.is_cylinder()) ||
         (pair.tool.is_cylinder() && pair.body.is_point());
}

/// The normal of the lateral surface of the cylinder at the point; those of the caps are axes.
void consider_radial(const CorePair& pair, BestNormal& best) {
  const Vector3 axis = pair.tool.is_cylinder() ? Vector3(pair.R_BT.col(2)) : Vector3::UnitZ();
  const Vector3 radial = pair.p_BT - axis * axis.dot(pair.p_BT);
  best.consider_both(radial.norm() > 0 ? radial.normalized() : axis.unitOrthogonal());
}

/// Makes the normal of curved cores more exact by nearest points of the cores moved apart along it.
/// What is left of its error each time is the depth, and what it is moved by, of the radius of
/// curvature. Gives the nearest points, if it got so far.
std::optional<Witness> polish(const CorePair& pair, BestNormal& best) {
  for (int i = 0; i < kMostPolishes; ++i) {
    const Vector3 n = best.best().n_B;
    const ClosestPoints apart = closest_points_moved_apart(pair, n, best.best().gap);
    best.refine(apart.n_B);
    if ((best.best().n_B - n).squaredNorm() < narrow::kPolished * narrow::kPolished) {
      return Witness{apart.p_tool, apart.p_body};
    }
  }
  return {};
}

/// The pair with the tool turned by some radians. `off`, m: how far its farthest point has moved,
/// and so the signed distance.
CorePair turned_by(double angle, const CorePair& pair, double& off) {
  const Vector3 turn = angle * Vector3(0.3, 0.5, 0.8);
  CorePair turned = pair;
  turned.R_BT = pair.R_BT * rotation_from_vector(turn).toRotationMatrix();
  off = turn.norm() * pair.tool.bounds(Pose{}).diagonal().norm();
  return turned;
}

/// Gap of cores that have too many axes to try. The normal of curved ones is made more exact by
/// nearest points. Where rounding stops the polytope, libccd has the last word, if it may; where it
/// takes too long, deeper than is promised, libccd, which takes ten times as long, is not asked.
CoreSeparation grown_penetration(const CorePair& pair, BestNormal& best, double touching_upper,
                                 bool curved) {
  double upper = touching_upper;
  std::optional<Witness> polished;
  const auto is_done_with = [&](const std::optional<CoreSeparation>& found) {
    if (!found) return false;
    best.consider(found->n_B);
    upper = std::min(upper, found->upper);
    if (curved) polished = polish(pair, best);
    return upper - best.best().gap <= narrow::kAccuracy;
  };
  const Vector3 between = pair.p_BT.isZero() ? Vector3(Vector3::UnitX()) : pair.p_BT.normalized();
  const double tolerance = curved ? narrow::kCurved : 0;
  bool too_long = false;
  const auto grow = [&](const CorePair& grown, double off) {
    return std::any_of(kAskew.begin(), kAskew.end(), [&](const Vector3& beside) {
      auto found = expanding_polytope(grown, (between + beside).normalized(), tolerance,
                                      touching_upper, too_long);
      if (found) found->upper += off;
      return is_done_with(found);
    });
  };
  bool done = grow(pair, 0);
  for (const double angle : kAskewTurns) {
    if (done || too_long) break;
    double off = 0;
    const CorePair turned = turned_by(angle, pair, off);
    done = grow(turned, off);
  }
  if (!done && !too_long && pair.may_allocate) is_done_with(ccd_penetration(pair));
  CoreSeparation result = best.best();
  result.upper = upper;
  result.nearest = polished;
  return result;
}

}  // namespace

CoreSeparation find_penetration(const CorePair& pair, const ClosestPoints& nearest) {
  BestNormal best(pair);
  const bool has_hull = pair.tool.is_hull() || pair.body.is_hull();
  if (!has_hull) for_each_axis(pair, [&](const Vector3& n) { best.consider(n); });
  if (pair.tool.face_normals().empty() && pair.body.face_normals().empty()) {
    consider_perpendiculars(pair, best);
  }
  if (!nearest.n_B.isZero()) best.consider(nearest.n_B);
  const bool point_in_cylinder = is_point_in_cylinder(pair);
  if (point_in_cylinder) consider_radial(pair, best);

  const bool polytopes = pair.tool.is_polytope() && pair.body.is_polytope();
  const bool few_axes = (polytopes && !has_hull) || point_in_cylinder;
  if (!few_axes) return grown_penetration(pair, best, nearest.upper, !polytopes);
  CoreSeparation exact = best.best();
  // If no axis separates the cores, they overlap by the best one. Otherwise they are apart by less
  // than kAccuracy, perhaps along another normal.
  exact.upper = exact.gap <= 0 ? exact.gap : nearest.upper;
  return exact;
}

CoreSeparation find_penetration_near(const CorePair& pair, const Vector3& before_B) {
  BestNormal best(pair, before_B);
  for_each_axis(pair, [&](const Vector3& n) { best.consider(n); });
  if (pair.tool.is_hull() || pair.body.is_hull()) consider_climb(pair, before_B, best);
  if (is_point_in_cylinder(pair)) consider_radial(pair, best);
  if (best.best().n_B.isZero(0)) best.consider(before_B);
  CoreSeparation result = best.best();
  result.upper = result.gap;
  return result;
}

}  // namespace hlm::geometry
