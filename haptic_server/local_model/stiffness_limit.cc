#include "haptic_server/local_model/stiffness_limit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// Relative excess over a limit that is rounding.
constexpr double kRounding = 1e-9;

template <class Matrix>
double largest_eigenvalue(const Matrix& symmetric) noexcept {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(symmetric, Eigen::EigenvaluesOnly);
  return std::max(0.0, solver.eigenvalues().maxCoeff());
}

}  // namespace

bool limits_stiffness(const LocalModelParameters& parameters) noexcept {
  return std::isfinite(parameters.max_stiffness_sum) ||
         std::isfinite(parameters.max_hand_stiffness) ||
         std::isfinite(parameters.max_hand_angular_stiffness) ||
         std::isfinite(parameters.max_contact_frequency);
}

double stiffness_scale(const MassMatrix& unit_stiffness, const Eigen::LLT<MassMatrix>& D,
                       const HandMap& H, const LocalModelParameters& parameters) noexcept {
  const double k = parameters.stiffness;
  const Matrix6 at_hand = H * unit_stiffness * H.transpose();
  double scale = 1;
  const auto limit = [&](double largest, double value) {
    if (value > (1 + kRounding) * largest) scale = std::min(scale, largest / value);
  };
  const double stiffness = largest_eigenvalue(Matrix3(at_hand.topLeftCorner<3, 3>()));
  limit(parameters.max_stiffness_sum, stiffness);
  limit(parameters.max_hand_stiffness, k * stiffness);
  if (std::isfinite(parameters.max_hand_angular_stiffness)) {
    limit(parameters.max_hand_angular_stiffness,
          k * largest_eigenvalue(Matrix3(at_hand.bottomRightCorner<3, 3>())));
  }
  if (std::isfinite(parameters.max_contact_frequency)) {
    const MassMatrix half = D.matrixL().solve(unit_stiffness);
    const MassMatrix inverse_masses = D.matrixL().solve(half.transpose());
    limit(parameters.max_contact_frequency * parameters.max_contact_frequency,
          k * largest_eigenvalue(inverse_masses));
  }
  return scale;
}

}  // namespace hlm::server
