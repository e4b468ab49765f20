#include "hlm/haptic_server/local_model/local_body.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// What is left of W below this part of its largest diagonal element is what rounding leaves of a
/// direction that joints have taken. Larger would freeze the heavy directions of a body with a
/// small inertia.
constexpr double kJointRounding = 1e-9;
/// Mobility that is none, 1/kg and 1/(kg·m²): of a body of a thousand million tons. With much less,
/// such as 1e-310, proxy and body become no numbers.
constexpr double kLeastMobility = 1e-12;

/// How fast the pace of a held body's time follows the environment's, 1/s: somewhat faster than a
/// client changes it. Faster is felt as a blow at each update.
constexpr double kPaceRate = 5;

/// Speeds at which nothing that a hand touches moves, m/s and rad/s: a body beyond them is the
/// product of numbers without sense.
constexpr double kLargestBodySpeed = 100;
constexpr double kLargestBodySpin = 1000;

/// B with W = B Bᵀ, one column for each direction in which the body can move: Cholesky's
/// factorisation with pivots, which ends at the rank. One that goes on divides rounding by
/// rounding.
Jacobian square_root(Matrix6 W) noexcept {
  const double smallest = std::max(kLeastMobility, kJointRounding * W.diagonal().maxCoeff());
  Jacobian B(6, 6);
  Eigen::Index columns = 0;
  for (Eigen::Index pivot = 0; columns < 6; ++columns) {
    if (!(W.diagonal().maxCoeff(&pivot) > smallest)) break;
    B.col(columns) = W.col(pivot) / std::sqrt(W(pivot, pivot));
    W -= B.col(columns) * B.col(columns).transpose();
    W.row(pivot).setZero();
    W.col(pivot).setZero();
  }
  B.conservativeResize(Eigen::NoChange, columns);
  return B;
}

}  // namespace

LocalBody::LocalBody(const MovableBody& reported) noexcept
    : id(reported.id),
      roundness(reported.roundness),
      axis_B(reported.axis_W.normalized()),
      V_W(reported.V_W),
      B(square_root(reported.W)),
      A_W(reported.A_W) {
  X_WB.p = reported.p_WCom;
}

LocalBody::LocalBody(const BodyInertia& known, const BodyPose& pose) noexcept
    : inertia(known), id(known.body) {
  X_WB = {pose.X_WB * known.p_BCom, pose.X_WB.R};
  V_W = shifted(pose.V_W, X_WB.p - pose.X_WB.p);
  const Eigen::SelfAdjointEigenSolver<Matrix3> principal(known.I_BCom);
  R_CP = principal.eigenvectors();
  if (R_CP.determinant() < 0) R_CP.col(0) *= -1;
  mobility_P = principal.eigenvalues().cwiseSqrt().cwiseInverse();
}

void LocalBody::begin_step(double dt) noexcept {
  if (!inertia || stands_still) return;
  const double before = pace;
  pace = std::clamp(wanted_pace, before - kPaceRate * dt, before + kPaceRate * dt);
  if (mechanism >= 0) return;
  if (pace != before) V_W *= before > 0 ? pace / before : 0;  // What stood still begins anew.
  const Matrix3 R_WP = X_WB.R.toRotationMatrix() * R_CP;
  B.setZero(6, 6);
  B.topLeftCorner<3, 3>().diagonal().setConstant(pace / std::sqrt(inertia->mass));
  B.bottomRightCorner<3, 3>() = pace * R_WP * mobility_P.asDiagonal();
  const Vector3 omega_P = R_WP.transpose() * V_W.tail<3>();
  const Vector3 inverse_P = mobility_P.cwiseAbs2();
  const Vector3 gyroscopic_P =
      inverse_P.cwiseProduct(omega_P.cwiseQuotient(inverse_P).cross(omega_P));
  const double damping = pace * inertia->damping;
  const double angular_damping = pace * inertia->angular_damping;
  A_W.head<3>() = pace * pace * inertia->gravity_W - damping / (1 + dt * damping) * V_W.head<3>();
  A_W.tail<3>() =
      R_WP * gyroscopic_P - angular_damping / (1 + dt * angular_damping) * V_W.tail<3>();
}

void move_with(LocalBody& body, const Mechanism& mechanism) noexcept {
  const Pose X_WB = mechanism.X_WB(body.member);
  body.X_WB = {X_WB * body.inertia->p_BCom, X_WB.R};
  body.V_W = mechanism.velocity(body.member, body.X_WB.p);
}

void begin_step(LocalBodies& bodies, Mechanisms& mechanisms, double dt) noexcept {
  for (LocalBody& body : bodies) {
    body.begin_step(dt);
    if (body.mechanism < 0) continue;
    Mechanism& mechanism = mechanisms[static_cast<std::size_t>(body.mechanism)];
    if (body.member == 0) mechanism.begin_step(dt, body.pace);
    move_with(body, mechanism);
    body.B = mechanism.mobility(body.member, body.X_WB.p);
    body.A_W = mechanism.acceleration(body.member, body.X_WB.p);
  }
}

Twist LocalBody::free_twist(double dt) const noexcept {
  Twist V = V_W + dt * (A_W + std::min(dt, A_changes_for) / 2 * A_rate_W);
  if (correction_steps > 0) V += correction / correction_steps;
  return V;
}

Vector3 LocalBody::turning_W() const noexcept {
  const Vector3 omega_W = V_W.tail<3>();
  if (roundness == Roundness::kSphere) return Vector3::Zero();
  if (roundness != Roundness::kAxis) return omega_W;
  const Vector3 axis_W = X_WB.R * axis_B;
  return omega_W - axis_W.dot(omega_W) * axis_W;
}

bool LocalBody::is_plausible() const noexcept {
  return X_WB.p.allFinite() && X_WB.R.coeffs().allFinite() &&
         V_W.head<3>().norm() <= kLargestBodySpeed && V_W.tail<3>().norm() <= kLargestBodySpin;
}

void LocalBody::hold(const Pose& X_WHeld) noexcept {
  X_WB = X_WHeld;
  stands_still = true;
  V_W.setZero();
  A_W.setZero();
  A_rate_W.setZero();
  correction.setZero();
  B.resize(6, 0);
}

void LocalBody::advance(const Twist& V, double dt) noexcept {
  if (correction_steps > 0) {
    correction -= correction / correction_steps;
    --correction_steps;
  }
  const Pose X_WBefore = X_WB;
  V_W = V;
  const double changes = std::min(dt, A_changes_for);
  A_W += changes * A_rate_W;
  A_changes_for -= changes;
  X_WB.p += dt * V_W.head<3>();
  X_WB.R = (rotation_from_vector(dt * turning_W()) * X_WB.R).normalized();
  if (!is_plausible()) hold(X_WBefore);
}

}  // namespace hlm::server
