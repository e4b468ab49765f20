#include "haptic_server/local_model/hand_map.h"

#include <Eigen/QR>

namespace hlm::server {
namespace {

/// Singular directions of the hand's mobility below this part of the largest are not inverted: a
/// linkage stretched out would otherwise turn rounding into force.
constexpr double kRankTolerance = 1e-8;

}  // namespace

HandMap hand_map(const Eigen::LLT<MassMatrix>& D, const Jacobian& J_h, double length) noexcept {
  // With B = S J_h L⁻ᵀ and S = diag(1, 1, 1, length, length, length), Eq. 8 reads
  // F = Sᵀ (B Bᵀ)⁺ B L⁻¹ τ = Sᵀ (Bᵀ)⁺ L⁻¹ τ.
  Vector6 scale;
  scale << 1, 1, 1, length, length, length;
  using Transposed = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMaxDof, 6>;
  const Transposed B_transposed = D.matrixL().solve(J_h.transpose() * scale.asDiagonal());
  Eigen::CompleteOrthogonalDecomposition<Transposed> decomposition;
  decomposition.setThreshold(kRankTolerance);
  decomposition.compute(B_transposed);
  const Eigen::Index d = J_h.cols();
  const MassMatrix L_inverse = D.matrixL().solve(MassMatrix::Identity(d, d));
  return scale.asDiagonal() * HandMap(decomposition.solve(L_inverse));
}

}  // namespace hlm::server
