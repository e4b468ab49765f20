#include "hlm/haptic_server/local_model/collision.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// Eigenvalues of A Aᵀ below this part of the largest count as rounding of zero. Larger would let
/// constraints at a small angle to each other through, smaller would invert noise.
constexpr double kRankTolerance = 1e-12;
/// Approach speeds below this part of the largest are left unresolved. Smaller admits columns that
/// depend on those already chosen.
constexpr double kApproachTolerance = 1e-9;

/// Rounds of active sets, each of which lowers the objective: far above what a tool and a few
/// bodies take; the penalty stops what a crowd leaves. More let a crowd take more of the tick.
constexpr int kMostRounds = 96;

/// -(Aᵀ A)⁺ w = -Aᵀ (A Aᵀ)⁺² A w.
ContactNumbers newton(const ImpulseColumns& A, const ContactNumbers& w) noexcept {
  const SystemMatrix gram = A.lazyProduct(A.transpose());
  const Eigen::SelfAdjointEigenSolver<SystemMatrix> eigen(gram);
  const double smallest = kRankTolerance * eigen.eigenvalues().maxCoeff();
  const Unknowns sum = A * w;
  Unknowns twice_inverted = Unknowns::Zero(A.rows());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    const double value = eigen.eigenvalues()[i];
    if (value <= smallest) continue;
    const auto axis = eigen.eigenvectors().col(i);
    twice_inverted -= axis.dot(sum) / (value * value) * axis;
  }
  return A.transpose() * twice_inverted;
}

/// min |A p|²/2 + w·p over p >= 0 by active sets (after Lawson and Hanson 1974). The passive
/// columns are independent, so there are at most n.
class NonnegativeImpulses {
 public:
  NonnegativeImpulses(const ImpulseColumns& A, const ContactNumbers& w,
                      double independence) noexcept
      : A_(A), w_(w), independence_(independence) {
    for (Eigen::Index i = 0; i < A.cols(); ++i) {
      const double length = A.col(i).norm();
      lengths_.push_back(length);
      if (length > 0) largest_approach_ = std::max(largest_approach_, std::abs(w[i]) / length);
    }
  }

  ContactNumbers solve() noexcept {
    for (int round = 0; round < kMostRounds; ++round) {
      const Eigen::Index entering = most_violated();
      if (entering < 0 || passive_.size() == passive_.capacity()) break;
      passive_.push_back({entering, 0.0});
      if (!factorise()) {
        left_out_.push_back(entering);
        passive_.pop_back();
        factorise();
        continue;
      }
      while (!step_towards_minimum()) {
        factorise();
      }
    }
    ContactNumbers p = ContactNumbers::Zero(A_.cols());
    for (const Passive& passive : passive_) p[passive.column] = passive.p;
    return p;
  }

 private:
  struct Passive {
    Eigen::Index column;
    double p;
  };

  Eigen::Index most_violated() const noexcept {
    Unknowns change = Unknowns::Zero(A_.rows());
    for (const Passive& passive : passive_) change += passive.p * A_.col(passive.column);
    Eigen::Index most = -1;
    double largest = kApproachTolerance * largest_approach_;
    for (Eigen::Index i = 0; i < A_.cols(); ++i) {
      const double approach = -(A_.col(i).dot(change) + w_[i]);
      const double length = lengths_[static_cast<std::size_t>(i)];
      if (approach > largest * length && !is_decided(i)) {
        largest = approach / length;
        most = i;
      }
    }
    return most;
  }

  bool is_decided(Eigen::Index column) const noexcept {
    const auto is_column = [&](const Passive& passive) { return passive.column == column; };
    return std::any_of(passive_.begin(), passive_.end(), is_column) ||
           std::find(left_out_.begin(), left_out_.end(), column) != left_out_.end();
  }

  /// Factorises the passive columns' Gram matrix. False if the last of them repeats the others.
  bool factorise() noexcept {
    const auto count = static_cast<Eigen::Index>(passive_.size());
    if (count == 0) return true;
    SystemMatrix columns(A_.rows(), count);
    for (Eigen::Index i = 0; i < count; ++i) {
      columns.col(i) = A_.col(passive_[static_cast<std::size_t>(i)].column);
    }
    gram_.compute(columns.transpose().lazyProduct(columns));
    const double length = lengths_[static_cast<std::size_t>(passive_.back().column)];
    return gram_.info() == Eigen::Success &&
           gram_.matrixLLT()(count - 1, count - 1) > independence_ * length;
  }

  /// Moves p to the minimum over the passive columns, or as far as it stays non-negative; then the
  /// columns that reached zero leave, and false is returned.
  bool step_towards_minimum() noexcept {
    const auto count = static_cast<Eigen::Index>(passive_.size());
    if (count == 0) return true;
    Unknowns target(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      target[i] = -w_[passive_[static_cast<std::size_t>(i)].column];
    }
    gram_.solveInPlace(target);

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

  const ImpulseColumns& A_;
  const ContactNumbers& w_;
  double independence_;
  double largest_approach_ = 0;
  StaticVector<double, kMaxCollisions> lengths_;
  Eigen::LLT<SystemMatrix> gram_;
  StaticVector<Passive, kMaxUnknowns> passive_;
  StaticVector<Eigen::Index, kMaxCollisions> left_out_;
};

}  // namespace

ContactNumbers collision_impulses(CollisionRule rule, const ImpulseColumns& A,
                                  const ContactNumbers& w, double independence) noexcept {
  switch (rule) {
    case CollisionRule::kNewton:
      return newton(A, w);
    case CollisionRule::kNonnegative:
      return NonnegativeImpulses(A, w, independence).solve();
  }
  return ContactNumbers::Zero(A.cols());
}

}  // namespace hlm::server
