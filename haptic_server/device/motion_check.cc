#include "hlm/device/motion_check.h"

namespace hlm::server {
namespace {

/// A matrix is a rotation's within this tolerance.
constexpr double kRotationTolerance = 1e-3;

}  // namespace

const char* MotionCheck::find_error(const Vector3& p, const Matrix3& R, const Twist& V,
                                    bool is_old) noexcept {
  if (!p.allFinite() || !R.allFinite() || !V.allFinite()) {
    return "its pose or its speed is not a number";
  }
  if (!(R.transpose() * R).isIdentity(kRotationTolerance)) return "its orientation is no rotation";
  if (R.determinant() < 0) return "its orientation is that of a mirror: its frame is left-handed";
  const bool freezes = V.head<3>().norm() > kStaleSpeed && p == p_before_;
  p_before_ = p;
  stale_ = is_old || freezes ? stale_ + 1 : 0;
  if (static_cast<double>(stale_) * dt_ < kLongestStale) return nullptr;
  return is_old ? "its library holds back new values: its time guard is longer than a tick"
                : "its pose stays the same while it says that it moves";
}

}  // namespace hlm::server
