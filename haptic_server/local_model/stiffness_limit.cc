#include "haptic_server/local_model/stiffness_limit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

template <class Matrix>
double largest_eigenvalue(const Matrix& symmetric) noexcept {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(symmetric, Eigen::EigenvaluesOnly);
  return std::max(0.0, solver.eigenvalues().maxCoeff());
}

}  // namespace

bool limits_stiffness(const LocalModelParameters& parameters) noexcept {
  return std::isfinite(parameters.max_hand_stiffness) ||
         std::isfinite(parameters.max_hand_angular_stiffness) ||
         std::isfinite(parameters.max_contact_frequency);
}

double stiffness_scale(const MassMatrix& unit_stiffness, const Eigen::LLT<MassMatrix>& D,
                       const HandMap& H, const LocalModelParameters& parameters) noexcept {
  const double k = parameters.stiffness;
  const Matrix6 at_hand = k * (H * unit_stiffness * H.transpose());
  const MassMatrix half = D.matrixL().solve(unit_stiffness);
  const MassMatrix squared_frequencies = k * D.matrixL().solve(half.transpose());

  const auto factor = [](double limit, double value) { return value > limit ? limit / value : 1; };
  return std::min({factor(parameters.max_hand_stiffness,
                          largest_eigenvalue(Matrix3(at_hand.topLeftCorner<3, 3>()))),
                   factor(parameters.max_hand_angular_stiffness,
                          largest_eigenvalue(Matrix3(at_hand.bottomRightCorner<3, 3>()))),
                   factor(parameters.max_contact_frequency * parameters.max_contact_frequency,
                          largest_eigenvalue(squared_frequencies))});
}

}  // namespace hlm::server
