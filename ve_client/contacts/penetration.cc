#include "ve_client/contacts/penetration.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <ccd/ccd.h>

namespace hlm::ve {
namespace {

/// A later candidate replaces an earlier one if its gap is larger by more than this, m. It keeps
/// the face normal when cross products of nearly parallel edges tie with it.
constexpr double kAdvantage = 1e-9;

/// libccd: the cores are swept by a ball of this radius, m, so that cores that only touch have a
/// depth. It is taken off again exactly.
constexpr double kBall = 1e-5;
/// libccd: tolerance of its expanding polytope, m². It ends once the square of the next support
/// point's distance from it is smaller, which leaves 3e-7 m for 1e-13; 1e-14 takes twice as long.
/// (The default, 1e-4, leaves centimetres.)
constexpr double kEpaTolerance = 1e-13;
/// libccd: iterations of its search for an overlap. 10 to 30 are usual.
constexpr unsigned long kMaxOverlapIterations = 200;
/// libccd itself does not bound the growth of its polytope. 100 support points of the two cores, in
/// all attempts, are usual, few pairs need 500. A pair for which this is too small, because it has
/// a circle of equally good normals, costs about 10 ms and is refused.
constexpr int kMaxSupports = 1000;
/// libccd: where to start, one attempt each. From some directions a symmetrical pair yields a flat
/// polytope, which cannot grow.
const std::array<Vector3, 3> kFirstDirections = {Vector3(1, 0, 0), Vector3(0.48, 0.6, 0.64),
                                                 Vector3(-0.64, 0.48, -0.6)};

/// Keeps the normal with the largest gap.
class BestNormal {
 public:
  explicit BestNormal(const CorePair& pair) : pair_(pair) {
    best_.gap = -std::numeric_limits<double>::infinity();
  }
  /// Only of normals within 30° of `near_B`, a unit vector.
  BestNormal(const CorePair& pair, const Vector3& near_B) : BestNormal(pair) { near_B_ = near_B; }

  void consider(const Vector3& n_B) {
    if (near_B_ && n_B.dot(*near_B_) < kNear) return;
    const double gap = pair_.gap(n_B);
    if (gap > best_.gap + kAdvantage) {
      best_.gap = gap;
      best_.n_B = n_B;
    }
  }
  void consider_both(const Vector3& direction) {
    consider(direction);
    consider(-direction);
  }
  const CoreSeparation& best() const { return best_; }

 private:
  static constexpr double kNear = 0.866;  // Cosine.

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

/// What libccd's callbacks see of one core.
struct CcdObject {
  const CorePair& pair;
  bool is_tool;
  double ball;  ///< Sweeps this core, m.
  const Vector3& first_direction;
  int& supports;  ///< Calls so far for both cores, in all attempts.
};

extern "C" void ccd_support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* result) {
  const auto& core = *static_cast<const CcdObject*>(object);
  Vector3 p = Vector3::Zero();
  // Past the limit both cores are the origin: libccd finds no progress and ends.
  if (++core.supports <= kMaxSupports) {
    const Vector3 d(direction->v[0], direction->v[1], direction->v[2]);
    p = core.is_tool ? core.pair.tool_support(d) : core.pair.body_support(d);
    if (const double length = d.norm(); length > 0) p += core.ball / length * d;
  }
  ccdVec3Set(result, p.x(), p.y(), p.z());
}

extern "C" void ccd_first_direction(const void* object, const void*, ccd_vec3_t* direction) {
  const Vector3& d = static_cast<const CcdObject*>(object)->first_direction;
  ccdVec3Set(direction, d.x(), d.y(), d.z());
}

/// Overlap of the cores by libccd: `gap` of its normal, and as `upper` what the depth of its
/// polytope, which lies inside the Minkowski difference, proves. None if it finds no overlap.
std::optional<CoreSeparation> expanding_polytope(const CorePair& pair,
                                                 const Vector3& first_direction, int& supports) {
  const CcdObject tool{pair, true, kBall, first_direction, supports};
  const CcdObject body{pair, false, 0, first_direction, supports};
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.first_dir = ccd_first_direction;
  ccd.support1 = ccd_support;
  ccd.support2 = ccd_support;
  ccd.max_iterations = kMaxOverlapIterations;
  ccd.epa_tolerance = kEpaTolerance;
  ccd.dist_tolerance = kEpaTolerance;
  ccd_real_t depth = 0;
  ccd_vec3_t direction;
  ccd_vec3_t position;
  if (ccdGJKPenetration(&tool, &body, &ccd, &depth, &direction, &position) != 0) return {};
  // libccd's direction is that in which its second object, the body, has to leave.
  const Vector3 n(-direction.v[0], -direction.v[1], -direction.v[2]);
  if (!(n.norm() > 0)) return {};
  const Vector3 n_B = n.normalized();
  return CoreSeparation{pair.gap(n_B), kBall - depth, n_B};
}

/// Gap of curved cores: libccd's answer is made more exact by nearest points.
CoreSeparation curved_penetration(const CorePair& pair, BestNormal& best, double upper) {
  int supports = 0;
  for (const Vector3& first_direction : kFirstDirections) {
    const auto found = expanding_polytope(pair, first_direction, supports);
    if (!found) continue;
    best.consider(found->n_B);
    best.consider(closest_points_moved_apart(pair, best.best().n_B, best.best().gap).n_B);
    upper = std::min(upper, found->upper);
    if (upper - best.best().gap <= kAccuracy) break;
  }
  CoreSeparation result = best.best();
  result.upper = upper;
  return result;
}

}  // namespace

CoreSeparation find_penetration(const CorePair& pair, const ClosestPoints& nearest) {
  BestNormal best(pair);
  for_each_axis(pair, [&](const Vector3& n) { best.consider(n); });
  if (pair.tool.face_normals().empty() && pair.body.face_normals().empty()) {
    consider_perpendiculars(pair, best);
  }
  if (!nearest.n_B.isZero()) best.consider(nearest.n_B);
  const bool point_in_cylinder = is_point_in_cylinder(pair);
  if (point_in_cylinder) consider_radial(pair, best);

  const bool polytopes = pair.tool.is_polytope() && pair.body.is_polytope();
  if (!polytopes && !point_in_cylinder) return curved_penetration(pair, best, nearest.upper);
  CoreSeparation exact = best.best();
  // If no axis separates the cores, they overlap by the best one. Otherwise they are apart by less
  // than kTouchingDistance, perhaps along another normal.
  exact.upper = exact.gap <= 0 ? exact.gap : nearest.upper;
  return exact;
}

CoreSeparation find_penetration_near(const CorePair& pair, const Vector3& before_B) {
  BestNormal best(pair, before_B);
  for_each_axis(pair, [&](const Vector3& n) { best.consider(n); });
  if (is_point_in_cylinder(pair)) consider_radial(pair, best);
  if (best.best().n_B.isZero(0)) best.consider(before_B);
  CoreSeparation result = best.best();
  result.upper = result.gap;
  return result;
}

}  // namespace hlm::ve
