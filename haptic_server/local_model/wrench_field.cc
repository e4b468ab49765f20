#include "hlm/haptic_server/local_model/wrench_field.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// Time constant in which what a report brings beyond what was found enters, s. Shorter lets a
/// payload of some times the tool's mass swing, longer lets the hand sink into a wall before it is
/// felt.
constexpr double kRise = 0.1;
/// Share of a fit that the next report leaves. More is slower to find what has changed, less finds
/// a payload's inertia in noise.
constexpr double kKept = 0.9;
/// Changes of speed (m/s) and of acceleration (m/s²) from which on a fit is sure of itself, and
/// forgets: at rest nothing is learned.
constexpr double kSureSpeed = 0.005;
constexpr double kSureAcceleration = 0.17;
/// Share of the changes of force that a fit must explain to count at all, and to count whole.
constexpr double kLeastExplained = 0.6;
constexpr double kWellExplained = 0.9;
/// Change of force that tells of stiffness, N. Below it is the noise of sensors and engines.
constexpr double kLeastChange = 0.1;
/// Largest stiffness that is found, N/m, and damping for its sake, s: without that a wall rings.
constexpr double kLargestStiffness = 5e4;
constexpr double kStiffnessTime = 0.002;
/// Time between two reports that are compared, at least, s: what changes in less is more noise than
/// motion.
constexpr double kLeastPeriod = 0.012;
/// What acts is at most so many times what was reported of late, and so much, N. More of a
/// stiffness that is none would be felt: of friction that turns, or of a sensor's noise.
constexpr double kExcess = 2;
constexpr double kLeastBound = 0.2;
/// Below this it is no wrench, N.
constexpr double kNone = 1e-6;

}  // namespace

Vector6 WrenchField::scaled(const Vector6& motion) const noexcept {
  Vector6 z = motion;
  z.tail<3>() *= length_;
  return z;
}

Vector6 WrenchField::scaled_force(const Wrench& F) const noexcept {
  Vector6 f = F;
  f.tail<3>() /= length_;
  return f;
}

void WrenchField::report(const WrenchReport& report) noexcept {
  // The first has no velocity before it, the second no acceleration.
  const double period = report.time - learned_.time;
  const bool due = reports_ == 0 || period > kLeastPeriod || period < 0;
  if (due) {
    if (reports_ > 0 && period > 0) {
      const Vector6 change_V = scaled(report.V_W - learned_.V_W);
      const Vector6 A = change_V / period;
      if (reports_ > 1) {
        learn(scaled(displacement(learned_.X_WL, report.X_WL)), change_V, A - A_,
              scaled_force(report.F_W - learned_.F_W));
      }
      A_ = A;
    }
    reports_ = std::min(reports_ + 1, 2);
    learned_ = report;
  }
  latest_ = report;
  jumps_ = true;
  if (!acts_) A_step_.setZero();
  acts_ = acts_ || !report.F_W.isZero(0);
}

void WrenchField::learn(const Vector6& moved, const Vector6& change_V, const Vector6& change_A,
                        const Vector6& change_F) noexcept {
  linear_.learn(change_V.head<3>(), change_A.head<3>(), change_F.head<3>());
  angular_.learn(change_V.tail<3>(), change_A.tail<3>(), change_F.tail<3>());
  learn_stiffness(moved, -change_F -
                             diagonal(linear_.damping, angular_.damping).cwiseProduct(change_V) -
                             diagonal(linear_.inertia, angular_.inertia).cwiseProduct(change_A));
}

/// Least squares with a little regularisation; a negative part is none.
void WrenchField::Response::learn(const Vector3& change_V, const Vector3& change_A,
                                  const Vector3& change_F) noexcept {
  constexpr double kV = kSureSpeed * kSureSpeed;
  constexpr double kA = kSureAcceleration * kSureAcceleration;
  const double excitation = change_V.squaredNorm() / kV + change_A.squaredNorm() / kA;
  const double kept = 1 - (1 - kKept) * std::min(excitation, 1.0);
  vv_ = kept * vv_ + change_V.squaredNorm();
  va_ = kept * va_ + change_V.dot(change_A);
  aa_ = kept * aa_ + change_A.squaredNorm();
  vf_ = kept * vf_ - change_V.dot(change_F);
  af_ = kept * af_ - change_A.dot(change_F);
  ff_ = kept * ff_ + change_F.squaredNorm();

  const double vv = vv_ + kV;
  const double aa = aa_ + kA;
  const double determinant = vv * aa - va_ * va_;
  double b = (vf_ * aa - af_ * va_) / determinant;
  double m = (af_ * vv - vf_ * va_) / determinant;
  if (b < 0) {
    b = 0;
    m = std::max(af_ / aa, 0.0);
  } else if (m < 0) {
    m = 0;
    b = std::max(vf_ / vv, 0.0);
  }
  const double explained = 2 * (b * vf_ + m * af_) - (b * b * vv_ + 2 * b * m * va_ + m * m * aa_);
  const double share = explained / std::max(ff_, kLeastChange * kLeastChange);
  const double trust =
      std::clamp((share - kLeastExplained) / (kWellExplained - kLeastExplained), 0.0, 1.0);
  damping = trust * b;
  inertia = trust * m;
}

/// BFGS: along the way that the link moved K becomes what was seen, across it K stays.
void WrenchField::learn_stiffness(const Vector6& moved, const Vector6& resisted) noexcept {
  const Vector6 expected = K_ * moved;
  if (!(std::max(expected.norm(), resisted.norm()) > kLeastChange)) return;
  const double curvature = moved.dot(expected);
  if (curvature > 0) K_ -= expected * expected.transpose() / curvature;
  const double work = moved.dot(resisted);
  if (work > 0) {
    const Vector6 way = resisted.normalized();
    const double stiffness = std::min(resisted.squaredNorm() / work, kLargestStiffness);
    K_ += stiffness * way * way.transpose();
  }
  // Rounding leaves negative ones.
  const Eigen::SelfAdjointEigenSolver<Matrix6> parts(K_);
  const Vector6 values = parts.eigenvalues().cwiseMax(0).cwiseMin(kLargestStiffness);
  K_ = parts.eigenvectors() * values.asDiagonal() * parts.eigenvectors().transpose();
}

/// Makes a part of what acts a constant, where it is larger than that.
template <int first, int count>
void WrenchField::bound(double most) noexcept {
  auto part = step_.F_W.segment<count>(first);
  const double size = part.norm();
  if (!(size > most)) return;
  part *= most / size;
  step_.stiffness.middleRows<count>(first).setZero();
  step_.stiffness.middleCols<count>(first).setZero();
}

WrenchField::Step WrenchField::begin_step(const Pose& X_WL, const Twist& V_W, double dt,
                                          double most) noexcept {
  V_ = scaled(V_W);
  const Vector6 b = diagonal(linear_.damping, angular_.damping);
  const Vector6 m = diagonal(linear_.inertia, angular_.inertia);
  reported_ = std::max(reported_ * std::exp(-dt / kRise), scaled_force(latest_.F_W).norm());
  const double believed = kExcess * reported_ + kLeastBound;
  step_.stiffness = K_;
  const double damps = kStiffnessTime * (K_ * V_).norm();
  step_.damping = kStiffnessTime * std::min(1.0, believed / std::max(damps, kNone)) * K_;
  step_.damping.diagonal() += b;
  step_.inertia = m.asDiagonal();
  const Vector6 follows = b.cwiseProduct(scaled(latest_.V_W)) + m.cwiseProduct(A_);
  step_.F_W = scaled_force(latest_.F_W) - K_ * scaled(displacement(latest_.X_WL, X_WL));
  if (jumps_) {
    jumps_ = false;
    gap_ = F_ - (step_.F_W + follows - step_.damping * V_ - m.cwiseProduct(A_step_));
  }
  gap_ *= std::exp(-dt / kRise);
  step_.F_W += gap_;
  bound<0, 6>(believed);
  step_.F_W += follows;
  bound<0, 3>(most);
  bound<3, 3>(most);
  const double ended = std::max({step_.F_W.norm(), F_.norm(), gap_.norm()});
  acts_ = ended > kNone || !latest_.F_W.isZero(0);

  Vector6 scale;
  scale << Vector3::Ones(), Vector3::Constant(length_);
  const auto unscaled = [&scale](const Matrix6& matrix) {
    return Matrix6(scale.asDiagonal() * matrix * scale.asDiagonal());
  };
  return {.F_W = step_.F_W.cwiseProduct(scale),
          .stiffness = unscaled(step_.stiffness),
          .damping = unscaled(step_.damping),
          .inertia = unscaled(step_.inertia)};
}

Wrench WrenchField::end_step(const Twist& V_W, double dt) noexcept {
  const Vector6 V = scaled(V_W);
  A_step_ = (V - V_) / dt;
  F_ = step_.F_W - dt * (step_.stiffness * V) - step_.damping * V - step_.inertia * A_step_;
  Wrench F = F_;
  F.tail<3>() *= length_;
  return F;
}

}  // namespace hlm::server
