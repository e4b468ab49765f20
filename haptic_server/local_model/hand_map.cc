#include "hlm/haptic_server/local_model/hand_map.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// Eigenvalues of the hand's mobility below this part of the largest are rounding of zero: the
/// directions in which the tool cannot move at all.
constexpr double kRankTolerance = 1e-12;

/// Largest ratio of a link's speed to the hand's that is felt as it is. Larger lets singular
/// postures amplify contacts more, smaller takes away where nothing is singular.
constexpr double kLargestRatio = 1.4;

/// Largest speed, m/s, of a point of any link but the hand's, in each of the motions D⁻¹ Jᵀ u for
/// the columns u of `directions`. Of a link with mass m, inertia I and centre of mass c it is
/// |v_c| + √(3 ωᵀIω/m), as for uniform rods about any axis.
Vector6 largest_speeds(const ToolModel& tool, const Jacobian& J_D,
                       const Matrix6& directions) noexcept {
  Vector6 largest = Vector6::Zero();
  for (int i = 0; i < tool.links(); ++i) {
    const Link& link = tool.description().links[static_cast<std::size_t>(i)];
    if (i == tool.description().hand_link || link.mass == 0) continue;
    const Jacobian J = tool.jacobian(i, tool.X_WL(i) * link.p_LCom);
    const Matrix6 twists = Matrix6(J.lazyProduct(J_D.transpose())) * directions;
    const Matrix3 R_LW = tool.X_WL(i).R.conjugate().toRotationMatrix();
    for (int k = 0; k < 6; ++k) {
      const Vector3 omega = R_LW * twists.col(k).tail<3>();
      const double turning = std::sqrt(3 * omega.dot(link.I_LCom * omega) / link.mass);
      largest[k] = std::max(largest[k], twists.col(k).head<3>().norm() + turning);
    }
  }
  return largest;
}

/// The inverse of an eigenvalue of the hand's mobility, damped: in the motion that a unit wrench
/// along its vector gives, the hand moves with `mobility` and other links with up to `speed`.
double damped_inverse(double mobility, double speed) noexcept {
  if (speed <= kLargestRatio * mobility) return 1 / mobility;
  const double x = kLargestRatio * mobility / speed;
  return x * x * (2 - x * x) / mobility;
}

/// Then J_h is square and regular, and Eq. 8 is its inverse.
bool is_free_rigid_body(const ToolModel& tool) noexcept {
  return tool.links() == 1 && tool.description().links[0].joint == JointType::kFree;
}

}  // namespace

HandMap hand_map(const ToolModel& tool, const Eigen::LLT<MassMatrix>& D,
                 const Jacobian& J_h) noexcept {
  if (is_free_rigid_body(tool)) {
    // J_h = [1, -[r]; 0, 1], so its inverse transposed has -[r] below.
    HandMap H = HandMap::Identity(6, 6);
    H.bottomLeftCorner<3, 3>() = J_h.topRightCorner<3, 3>();
    return H;
  }
  // Eq. 8 with the rotations of J_h in units of length.
  const double length = tool.description().length;
  Vector6 scale;
  scale << 1, 1, 1, length, length, length;
  const Jacobian J = scale.asDiagonal() * J_h;
  const Jacobian J_D = D.solve(J.transpose()).transpose();  // J D⁻¹
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(Matrix6(J_D.lazyProduct(J.transpose())));
  const Vector6& mobility = eigen.eigenvalues();
  const Vector6 speeds = largest_speeds(tool, J_D, eigen.eigenvectors());

  const double smallest = kRankTolerance * mobility.maxCoeff();
  Vector6 inverse = Vector6::Zero();
  for (int k = 0; k < 6; ++k) {
    if (mobility[k] > smallest) inverse[k] = damped_inverse(mobility[k], speeds[k]);
  }
  const Matrix6 lambda =
      eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  return (scale.asDiagonal() * lambda).lazyProduct(J_D);
}

}  // namespace hlm::server
