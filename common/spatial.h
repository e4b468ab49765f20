// Spatial quantities: vectors, poses, twists and wrenches.
//
// Notation (after Drake's monogram notation): X_AB is the pose of frame B in frame A, R_AB its
// rotation, p_AB the position of B's origin in A. W world, T virtual tool, L a link of it, P proxy,
// D device, H hand, C contact point. SI units throughout.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace hlm {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Quaternion = Eigen::Quaterniond;

/// Allowed deviation of a unit vector's or quaternion's length from 1 where it comes from outside:
/// what single precision and a few operations leave, far below what a wrong unit would give.
inline constexpr double kUnitTolerance = 1e-3;

/// Velocity of a body: [linear velocity of the named point, m/s; angular velocity, rad/s].
using Twist = Vector6;
/// Force on a body: [force, N; torque about the named point, N·m].
using Wrench = Vector6;

/// Rigid transformation X_AB. Invariant: R is a unit quaternion.
struct Pose {
  Vector3 p = Vector3::Zero();            ///< p_AB, m.
  Quaternion R = Quaternion::Identity();  ///< R_AB.

  /// p_AQ from p_BQ.
  Vector3 operator*(const Vector3& p_BQ) const noexcept { return p + R * p_BQ; }
  /// X_AC from X_BC.
  Pose operator*(const Pose& X_BC) const noexcept { return {p + R * X_BC.p, R * X_BC.R}; }
  /// X_BA.
  Pose inverse() const noexcept { return {R.conjugate() * -p, R.conjugate()}; }

  bool operator==(const Pose& other) const noexcept {
    return p == other.p && R.coeffs() == other.R.coeffs();
  }
};

/// A pose that many points are taken through.
struct Placement {
  Vector3 p = Vector3::Zero();      ///< p_AB, m.
  Matrix3 R = Matrix3::Identity();  ///< R_AB.

  Placement() = default;
  Placement(const Vector3& p_AB, const Matrix3& R_AB) noexcept : p(p_AB), R(R_AB) {}
  explicit Placement(const Pose& X_AB) noexcept : p(X_AB.p), R(X_AB.R.toRotationMatrix()) {}

  /// p_AQ from p_BQ.
  Vector3 operator*(const Vector3& p_BQ) const noexcept { return p + R * p_BQ; }
  /// X_AC from X_BC.
  Placement operator*(const Placement& X_BC) const noexcept { return {p + R * X_BC.p, R * X_BC.R}; }
  /// X_BA.
  Placement inverse() const noexcept { return {-(R.transpose() * p), R.transpose()}; }
};

/// Matrix of the cross product: skew(a) b = a × b.
inline Matrix3 skew(const Vector3& a) noexcept {
  Matrix3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

/// [a, a, a, b, b, b].
inline Vector6 diagonal(double a, double b) noexcept {
  return (Vector6() << Vector3::Constant(a), Vector3::Constant(b)).finished();
}

/// Rotation vector (axis times angle, rad) of R, angle in [0, π].
inline Vector3 rotation_vector(const Quaternion& R) noexcept {
  // q and -q are one rotation; w >= 0 selects the shorter way round.
  const double sign = R.w() < 0 ? -1.0 : 1.0;
  const double sine = R.vec().norm();
  // Below this sine (of half the angle) the series 2·vec is exact to double precision.
  constexpr double kSmallSine = 1e-9;
  if (sine < kSmallSine) return 2.0 * sign * R.vec();
  return (2.0 * std::atan2(sine, sign * R.w()) * sign / sine) * R.vec();
}

/// Rotation whose rotation vector is r (rad).
inline Quaternion rotation_from_vector(const Vector3& r) noexcept {
  const double angle = r.norm();
  constexpr double kSmallAngle = 1e-9;
  if (angle < kSmallAngle) {
    return Quaternion(1.0, r.x() / 2, r.y() / 2, r.z() / 2).normalized();
  }
  return Quaternion(Eigen::AngleAxisd(angle, r / angle));
}

/// Displacement from X_WA to X_WB in world axes: [p_WB - p_WA, m; rotation vector of R_WB R_WAᵀ,
/// rad].
inline Vector6 displacement(const Pose& X_WA, const Pose& X_WB) noexcept {
  Vector6 e;
  e << X_WB.p - X_WA.p, rotation_vector(X_WB.R * X_WA.R.conjugate());
  return e;
}

}  // namespace hlm
