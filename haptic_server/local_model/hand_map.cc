#include "haptic_server/local_model/hand_map.h"

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// Eigenvalues of the hand's mobility below this part of the largest are not inverted: a linkage
/// stretched out would otherwise turn rounding into force.
constexpr double kRankTolerance = 1e-12;

Matrix6 pseudo_inverse(const Matrix6& symmetric) noexcept {
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(symmetric);
  const double smallest = kRankTolerance * eigen.eigenvalues().maxCoeff();
  const Vector6 inverted =
      (eigen.eigenvalues().array() > smallest).select(eigen.eigenvalues().cwiseInverse(), 0.0);
  return eigen.eigenvectors() * inverted.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

HandMap hand_map(const Eigen::LLT<MassMatrix>& D, const Jacobian& J_h, double length) noexcept {
  // Eq. 8 with the rotations of J_h in units of length.
  Vector6 scale;
  scale << 1, 1, 1, length, length, length;
  const Jacobian J = scale.asDiagonal() * J_h;
  const Jacobian J_D = D.solve(J.transpose()).transpose();  // J D⁻¹
  const Matrix6 lambda = pseudo_inverse(J_D.lazyProduct(J.transpose()));
  return (scale.asDiagonal() * lambda).lazyProduct(J_D);
}

}  // namespace hlm::server
