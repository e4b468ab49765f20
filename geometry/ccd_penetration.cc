#include "hlm/geometry/ccd_penetration.h"

#include <ccd/ccd.h>

namespace hlm::geometry {
namespace {

/// libccd: the cores are swept by a ball of this radius, m, so that cores that only touch have a
/// depth. It is taken off again exactly.
constexpr double kBall = 1e-5;
/// libccd: tolerance of its expanding polytope, m². It ends once the square of the next support
/// point's distance from it is smaller, which leaves 3e-7 m for 1e-13; 1e-14 takes twice as long.
/// (The default, 1e-4, leaves centimetres.)
constexpr double kEpaTolerance = 1e-13;
/// libccd: iterations of its search for an overlap. 10 to 30 are usual.
constexpr unsigned long kMaxOverlapIterations = 200;
/// libccd itself does not bound the growth of its polytope. 100 support points of the two cores
/// are usual. A pair for which this is too small, because it has a circle of equally good normals,
/// costs about 10 ms and is refused.
constexpr int kMaxSupports = 1000;

/// What libccd's callbacks see of one core.
struct CcdObject {
  const CorePair& pair;
  bool is_tool;
  double ball;    ///< Sweeps this core, m.
  int& supports;  ///< Calls so far for both cores.
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

}  // namespace

std::optional<CoreSeparation> ccd_penetration(const CorePair& pair) {
  int supports = 0;
  const CcdObject tool{pair, true, kBall, supports};
  const CcdObject body{pair, false, 0, supports};
  ccd_t ccd;
  CCD_INIT(&ccd);
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
  return CoreSeparation{pair.gap(n_B), kBall - depth, n_B, {}};
}

}  // namespace hlm::geometry
