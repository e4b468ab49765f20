#include "haptic_server/local_model/collision.h"

#include <algorithm>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace hlm::server {
namespace {

/// Eigenvalues of L⁻¹ J_cᵀ J_c L⁻ᵀ below this part of the largest count as rounding of zero. Larger
/// would let constraints at a small angle to each other through, smaller would invert noise.
constexpr double kRankTolerance = 1e-12;
/// Approach speeds below this part of the total are left unresolved. Smaller admits columns that
/// depend on those already chosen.
constexpr double kApproachTolerance = 1e-9;

/// (1+e) times the projection of u on the span of the columns of A, negated.
Velocity newton(const ContactNormals& A, const Velocity& u, double restitution) noexcept {
  const MassMatrix gram = A * A.transpose();
  const Eigen::SelfAdjointEigenSolver<MassMatrix> eigen(gram);
  const double smallest = kRankTolerance * eigen.eigenvalues().maxCoeff();
  Velocity change = Velocity::Zero(u.size());
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    if (eigen.eigenvalues()[i] <= smallest) continue;
    const auto axis = eigen.eigenvectors().col(i);
    change -= (1 + restitution) * axis.dot(u) * axis;
  }
  return change;
}

/// Least squares min |A p - b| over p >= 0 by active sets (Lawson and Hanson 1974). The passive
/// columns are independent, hence at most d.
class NonnegativeLeastSquares {
 public:
  NonnegativeLeastSquares(const ContactNormals& A, const Velocity& b) noexcept : A_(A), b_(b) {}

  /// A p.
  Velocity solve() noexcept {
    // Each round lowers the residual; the bound only guards against cycling by rounding.
    const Eigen::Index most_rounds = 2 * kMaxDof + A_.cols();
    for (Eigen::Index round = 0; round < most_rounds; ++round) {
      const Eigen::Index entering = most_violated();
      if (entering < 0 || passive_.size() == passive_.capacity()) break;
      passive_.push_back({entering, 0.0});
      while (!step_towards_least_squares()) {
      }
    }
    return image();
  }

 private:
  struct Passive {
    Eigen::Index column;
    double p;
  };
  using Columns = MassMatrix;

  Velocity image() const noexcept {
    Velocity sum = Velocity::Zero(b_.size());
    for (const Passive& passive : passive_) sum += passive.p * A_.col(passive.column);
    return sum;
  }

  Eigen::Index most_violated() const noexcept {
    const Velocity residual = b_ - image();
    Eigen::Index most = -1;
    double largest = kApproachTolerance * b_.norm();
    for (Eigen::Index i = 0; i < A_.cols(); ++i) {
      const double gain = A_.col(i).dot(residual);
      const double length = A_.col(i).norm();
      if (gain > largest * length && !is_passive(i)) {
        largest = gain / length;
        most = i;
      }
    }
    return most;
  }

  bool is_passive(Eigen::Index column) const noexcept {
    for (const Passive& passive : passive_) {
      if (passive.column == column) return true;
    }
    return false;
  }

  /// Moves p to the least squares solution over the passive columns, or as far as it stays
  /// non-negative; then the columns that reached zero leave, and false is returned.
  bool step_towards_least_squares() noexcept {
    const auto count = static_cast<Eigen::Index>(passive_.size());
    Columns columns(A_.rows(), count);
    for (Eigen::Index i = 0; i < count; ++i) {
      columns.col(i) = A_.col(passive_[static_cast<std::size_t>(i)].column);
    }
    const Velocity target = Eigen::ColPivHouseholderQR<Columns>(columns).solve(b_);

    double portion = 1;
    for (Eigen::Index i = 0; i < count; ++i) {
      const double p = passive_[static_cast<std::size_t>(i)].p;
      if (target[i] <= 0) portion = std::min(portion, p / (p - target[i]));
    }
    for (Eigen::Index i = 0; i < count; ++i) {
      double& p = passive_[static_cast<std::size_t>(i)].p;
      p = portion < 1 && target[i] <= 0 && p / (p - target[i]) <= portion
              ? 0
              : p + portion * (target[i] - p);
    }
    if (portion == 1) return true;
    erase_if(passive_, [](const Passive& passive) { return passive.p <= 0; });
    return false;
  }

  const ContactNormals& A_;
  const Velocity& b_;
  StaticVector<Passive, kMaxDof> passive_;
};

}  // namespace

GeneralisedForce collision_impulse(CollisionRule rule, const Eigen::LLT<MassMatrix>& D,
                                   const ContactNormals& normals, const Velocity& v,
                                   double restitution) noexcept {
  // In u = Lᵀ q̇ kinetic energy is |u|²/2 and an impulse J_cᵀ p changes u by A p, A = L⁻¹ J_cᵀ.
  const ContactNormals A = D.matrixL().solve(normals);
  const Velocity u = D.matrixU() * v;
  switch (rule) {
    case CollisionRule::kNewton:
      return D.matrixL() * newton(A, u, restitution);
    case CollisionRule::kNonnegative: {
      const Velocity b = -(1 + restitution) * u;
      return D.matrixL() * NonnegativeLeastSquares(A, b).solve();
    }
  }
  return GeneralisedForce::Zero(v.size());
}

}  // namespace hlm::server
