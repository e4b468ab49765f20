#include "hlm/haptic_server/local_model/stiffness_limit.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <Eigen/Eigenvalues>

namespace hlm::server {
namespace {

/// How fast the factor may change, 1/s. Faster is felt as a jump where contacts come or go under
/// load; slower leaves the stiffness above its limit for longer.
constexpr double kFactorRate = 10;

/// Relative excess over a limit that is rounding.
constexpr double kLimitRounding = 1e-9;

template <class Matrix>
double largest_eigenvalue(const Matrix& symmetric) noexcept {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(symmetric, Eigen::EigenvaluesOnly);
  return std::max(0.0, solver.eigenvalues().maxCoeff());
}

/// Contacts between the same links of the tool, or of one link with what is not the tool.
struct Links {
  FrameIndex a;
  FrameIndex b;  ///< kWorldFrame: none of the tool's.

  explicit Links(const LocalContact& contact) noexcept
      : a(contact.frame_a),
        b(contact.b.kind == SideKind::kToolLink ? contact.frame_b : kWorldFrame) {}
  bool operator==(const Links&) const = default;
};

/// Calls `add` with the contacts that follow one another between the same links.
template <class Add>
void by_links(const LocalContacts& contacts, Add add) noexcept {
  const LocalContact* const end = contacts.data() + contacts.size();
  for (const LocalContact* first = contacts.data(); first != end;) {
    const Links links(*first);
    const LocalContact* last = first + 1;
    while (last != end && Links(*last) == links) ++last;
    add(links, std::span(first, last));
    first = last;
  }
}

/// Σ n nᵀ, and the same with the moments about O in the last three rows.
Matrix3 sum_of_normals(std::span<const LocalContact> contacts) noexcept {
  Matrix3 sum = Matrix3::Zero();
  for (const LocalContact& contact : contacts) {
    sum.noalias() += contact.now.n_W * contact.now.n_W.transpose();
  }
  return sum;
}
Matrix6 sum_of_wrenches(std::span<const LocalContact> contacts, const Vector3& O_W) noexcept {
  Matrix6 sum = Matrix6::Zero();
  for (const LocalContact& contact : contacts) {
    Vector6 w;
    w << contact.now.n_W, (contact.now.p_W - O_W).cross(contact.now.n_W);
    sum.noalias() += w * w.transpose();
  }
  return sum;
}

/// Σ M J_iᵀ n nᵀ J_i Mᵀ over the contacts: how their stiffness adds up, per unit of k, in the
/// coordinates to which the rows of M lead from generalised forces.
template <class Sum, class Map>
Sum summed(const LocalContacts& contacts, const FrameMotions& frames, const Map& M) noexcept {
  Sum sum = Sum::Zero(M.rows(), M.rows());
  by_links(contacts, [&](const Links& links, std::span<const LocalContact> between) {
    Jacobian J = frames[links.a].J;
    if (links.b != kWorldFrame) J -= frames[links.b].J;
    const auto MJ = M.lazyProduct(J.transpose()).eval();
    const auto straight = MJ.template leftCols<3>();
    if (MJ.template rightCols<3>().isZero(0)) {
      sum += straight.lazyProduct(sum_of_normals(between)).lazyProduct(straight.transpose());
    } else {
      const Matrix6 wrenches = sum_of_wrenches(between, frames.reference_W());
      sum += MJ.lazyProduct(wrenches).lazyProduct(MJ.transpose());
    }
  });
  return sum;
}

/// Whether the hand feels no contact stronger than it is: the tool is one body that no axis holds.
bool is_unheld(const ToolModel& tool) noexcept {
  const JointType joint = tool.description().links[0].joint;
  return tool.links() == 1 && (joint == JointType::kFree || joint == JointType::kPlanar);
}

}  // namespace

double StiffnessLimit::largest_of(const Matrix3& per_k) noexcept {
  if (per_k != per_k_) {
    per_k_ = per_k;
    largest_ = largest_eigenvalue(per_k);
  }
  return largest_;
}

void StiffnessLimit::limit(const ToolModel& tool, const LocalContacts& contacts,
                           const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D,
                           const HandMap& H, const LocalModelParameters& parameters,
                           double dt) noexcept {
  if (contacts.empty()) return;  // A hand that bounces back finds what it left.
  const double target = scale(tool, contacts, frames, D, H, parameters);
  const bool touches =
      std::ranges::any_of(contacts, [](const auto& contact) { return contact.now.s < 0; });
  const double change = touches ? kFactorRate * dt : 1;
  factor_ = std::clamp(target, factor_ - change, factor_ + change);
}

double StiffnessLimit::scale(const ToolModel& tool, const LocalContacts& contacts,
                             const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D,
                             const HandMap& H, const LocalModelParameters& parameters) noexcept {
  if (contacts.empty()) return 1;
  const double k = parameters.stiffness;
  double scale = 1;
  const auto limit = [&](double largest, double value) {
    if (value > (1 + kLimitRounding) * largest) scale = std::min(scale, largest / value);
  };
  const double most = std::min(parameters.max_stiffness_sum, parameters.max_hand_stiffness / k);
  const bool may_exceed = static_cast<double>(contacts.size()) > most || !is_unheld(tool);
  if (std::isfinite(most) && may_exceed) {
    const auto per_k = summed<Matrix3>(contacts, frames, H.topRows<3>());
    if (per_k.trace() > most) limit(most, largest_of(per_k));
  }
  if (std::isfinite(parameters.max_hand_angular_stiffness)) {
    limit(parameters.max_hand_angular_stiffness,
          k * largest_eigenvalue(summed<Matrix3>(contacts, frames, H.bottomRows<3>())));
  }
  if (std::isfinite(parameters.max_contact_frequency)) {
    const MassMatrix identity = MassMatrix::Identity(H.cols(), H.cols());
    const MassMatrix half = D.matrixL().solve(summed<MassMatrix>(contacts, frames, identity));
    const MassMatrix inverse_masses = D.matrixL().solve(half.transpose());
    limit(parameters.max_contact_frequency * parameters.max_contact_frequency,
          k * largest_eigenvalue(inverse_masses));
  }
  return scale;
}

}  // namespace hlm::server
