#include "hlm/device/motion_check.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {
namespace {

/// A matrix is a rotation's within this tolerance.
constexpr double kRotationTolerance = 1e-3;
/// A mean over a window is the same for as long as the window, after a single step.
constexpr double kBeyondWindow = 5e-3;
/// Nobody looked for longer, s: where the handle went meanwhile is not known.
constexpr double kLongestGap = 0.02;

}  // namespace

void MotionCheck::begin(double window) noexcept {
  has_begun_ = false;
  longest_stale_ = std::max(kLongestStale, window + kBeyondWindow);
}

const char* MotionCheck::find_error(double now, const Vector3& p, const Matrix3& R, const Twist& V,
                                    bool is_old) noexcept {
  if (!p.allFinite() || !R.allFinite() || !V.allFinite()) {
    return "its pose or its speed is not a number";
  }
  if (!(R.transpose() * R).isIdentity(kRotationTolerance)) return "its orientation is no rotation";
  if (R.determinant() < 0) return "its orientation is that of a mirror: its frame is left-handed";
  const Vector3 v = V.head<3>();
  if (!has_begun_) {
    p_ = p;
    v_ = v;
    now_ = fresh_at_ = changed_at_ = moved_at_ = now;
    unexplained_.setZero();
    speed_ = v.norm();
    has_begun_ = true;
  }
  const char* const jump = find_jump(now, p, v);
  const char* const stale = find_stale(now, p, v, is_old);
  p_ = p;
  v_ = v;
  now_ = now;
  return stale != nullptr ? stale : jump;
}

const char* MotionCheck::find_stale(double now, const Vector3& p, const Vector3& v,
                                    bool is_old) noexcept {
  const bool rests = v.norm() <= kStaleSpeed;
  if (!is_old) fresh_at_ = now;
  if (rests || p != p_) moved_at_ = now;
  if (rests || p != p_ || v != v_) changed_at_ = now;
  if (now - fresh_at_ >= kLongestStale) {
    return "its library holds back new values: its time guard is longer than a tick";
  }
  const bool is_frozen = now - changed_at_ >= longest_stale_ || now - moved_at_ >= kLongestStop;
  return is_frozen ? "its pose stays the same while it says that it moves" : nullptr;
}

/// Of a low-pass with time constant τ the way that is not explained is τ times the change of the
/// reported speed; of a mean over a window it is at most the window times the largest speed.
const char* MotionCheck::find_jump(double now, const Vector3& p, const Vector3& v) noexcept {
  const double dt = now - now_;
  const double forgets = std::exp(-dt / kMemory);
  speed_ = std::max(forgets * speed_, v.norm());
  if (dt > kLongestGap) {
    unexplained_.setZero();
    return nullptr;
  }
  const Vector3 way = p - p_;
  unexplained_ = forgets * (unexplained_ + way - dt / 2 * (v + v_));
  if (way.norm() > kFarthestJump + kFastest * (now - moved_at_)) {
    return "its pose jumps farther than a hand can move it";
  }
  const bool is_led = unexplained_.norm() <= kFarthestJump + kLongestLag * speed_;
  return is_led ? nullptr : "its pose moves otherwise than its speed says";
}

}  // namespace hlm::server
