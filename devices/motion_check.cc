#include "hlm/devices/motion_check.h"

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
/// Longest time of a step from which a speed is taken, and longest doubt about it, s.
constexpr double kLongestStepTime = 4e-3;
constexpr double kLongestDoubt = 2e-3;

}  // namespace

void MotionCheck::begin(double window, SpeedSource source) noexcept {
  has_begun_ = false;
  longest_stale_ = std::max(kLongestStale, window + kBeyondWindow);
  source_ = source;
}

const char* MotionCheck::find_error(double now, const Vector3& p, const Matrix3& R, const Twist& V,
                                    bool is_old, double age) noexcept {
  if (!p.allFinite() || !R.allFinite() || !V.allFinite()) {
    return "its pose or its speed is not a number";
  }
  if (!(R.transpose() * R).isIdentity(kRotationTolerance)) return "its orientation is no rotation";
  if (R.determinant() < 0) return "its orientation is that of a mirror: its frame is left-handed";
  if (!has_begun_) {
    p_ = p;
    R_ = R;
    V_ = V;
    now_ = fresh_at_ = changed_at_ = moved_at_ = stepped_at_ = turned_at_ = now;
    age_ = age;
    unexplained_.setZero();
    step_speed_.setZero();
    speed_ = V.head<3>().norm();
    has_begun_ = true;
  }
  const char* const jump = find_jump(now, p, R, V.head<3>(), age);
  observe_change(now, p, R, V, age);
  if (!is_old) fresh_at_ = now;
  const char* const stale = find_stale(now - age);
  p_ = p;
  R_ = R;
  V_ = V;
  now_ = now;
  age_ = age;
  return stale != nullptr ? stale : jump;
}

void MotionCheck::observe_change(double now, const Vector3& p, const Matrix3& R, const Twist& V,
                                 double age) noexcept {
  const Twist change = V - V_;
  const bool rests = V.head<3>().norm() <= kStaleSpeed;
  const bool turns = V.tail<3>().norm() > kStaleTurn;
  if (rests || p != p_) moved_at_ = now;
  if (rests || p != p_ || !change.head<3>().isZero(0)) changed_at_ = now;
  if (!turns || R != R_ || !change.tail<3>().isZero(0)) turned_at_ = now;
  if (p != p_) observe_step(now, p - p_, age);
}

/// Of a step that took long, or whose time is not sure, nobody knows how fast it ended.
void MotionCheck::observe_step(double now, const Vector3& way, double age) noexcept {
  const double time = now - stepped_at_;
  const bool is_known = time > 0 && time < kLongestStepTime && std::max(age, age_) < kLongestDoubt;
  const double forgets = is_known ? std::exp(-time / kBraking) : 0;
  const Vector3 speed = is_known ? Vector3(way / time) : Vector3(Vector3::Zero());
  step_speed_ = forgets * step_speed_ + (1 - forgets) * speed;
  stepped_at_ = now;
}

/// seen: the earliest time of the latest values, s.
const char* MotionCheck::find_stale(double seen) const noexcept {
  if (seen - fresh_at_ >= kLongestStale) {
    return "its library holds back new values: its time guard is longer than a tick";
  }
  if (source_ == SpeedSource::kDriver) {
    const bool stands = seen - stepped_at_ >= kLongestStale;
    return stands && step_speed_.norm() > kHardestStop
               ? "its state is frozen: its pose stands right after it moved, where no hand stops it"
               : nullptr;
  }
  if (seen - changed_at_ >= longest_stale_ || seen - moved_at_ >= kLongestStop) {
    return "its state is frozen: its pose stays the same while it says that it moves";
  }
  return seen - turned_at_ < std::max(kLongestStaleTurn, longest_stale_)
             ? nullptr
             : "its state is frozen: its orientation stays the same while it says that it turns";
}

/// Of a low-pass with time constant τ the way that is not explained is τ times the change of the
/// reported speed; of a mean over a window it is at most the window times the largest speed.
const char* MotionCheck::find_jump(double now, const Vector3& p, const Matrix3& R, const Vector3& v,
                                   double age) noexcept {
  const double dt = now - now_;
  const double doubt = std::max(age, age_);
  const double forgets = std::exp(-dt / kMemory);
  speed_ = std::max(forgets * speed_, v.norm());
  if (dt + doubt > kLongestGap) {
    unexplained_.setZero();
    return nullptr;
  }
  const Vector3 way = p - p_;
  unexplained_ = forgets * (unexplained_ + way - dt / 2 * (v + V_.head<3>()));
  if (way.norm() > kFarthestJump + kFastest * (now - moved_at_ + doubt)) {
    return "its pose jumps farther than a hand can move it";
  }
  const double cosine = ((R_.transpose() * R).trace() - 1) / 2;
  if (cosine < std::cos(kFarthestTurn + kFastestTurn * (dt + doubt))) {
    return "its orientation jumps farther than a hand can turn it";
  }
  const double farthest = kFarthestJump + (kLongestLag + doubt) * speed_;
  const bool is_led = source_ == SpeedSource::kDriver || unexplained_.norm() <= farthest;
  return is_led ? nullptr : "its pose moves otherwise than its speed says";
}

}  // namespace hlm::server
