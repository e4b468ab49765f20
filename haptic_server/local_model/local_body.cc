#include "haptic_server/local_model/local_body.h"

#include <Eigen/Cholesky>

namespace hlm::server {
namespace {

/// Pivots of W below this part of the largest are what rounding leaves of a direction that joints
/// have taken. Larger would freeze the heavy directions of a body with a small inertia.
constexpr double kRankTolerance = 1e-9;

/// B with W = B Bᵀ, one column for each direction in which the body can move.
Jacobian square_root(const Matrix6& W) noexcept {
  const Eigen::LDLT<Matrix6> ldlt(W);
  const Matrix6 L = ldlt.transpositionsP().transpose() * Matrix6(ldlt.matrixL());
  const Vector6 pivots = ldlt.vectorD();
  const double smallest = kRankTolerance * pivots.maxCoeff();
  Jacobian B(6, 6);
  int columns = 0;
  for (int i = 0; i < 6; ++i) {
    if (pivots[i] > smallest) B.col(columns++) = std::sqrt(pivots[i]) * L.col(i);
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

Twist LocalBody::free_twist(double dt) const noexcept {
  Twist V = V_W + dt * A_W;
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

void LocalBody::advance(const Twist& V, double dt) noexcept {
  if (correction_steps > 0) {
    correction -= correction / correction_steps;
    --correction_steps;
  }
  V_W = V;
  X_WB.p += dt * V_W.head<3>();
  X_WB.R = (rotation_from_vector(dt * turning_W()) * X_WB.R).normalized();
}

}  // namespace hlm::server
