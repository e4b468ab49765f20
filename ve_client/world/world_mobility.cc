// How bodies that joints connect answer forces.
#include <algorithm>
#include <vector>

#include <Eigen/Dense>

#include "hlm/ve_client/world/world.h"

namespace hlm::ve {
namespace {

constexpr int kNone = -1;

/// Bodies that joints connect, and the joints. The fixed ones are not among them.
class JointedGroup {
 public:
  JointedGroup(const World& world, int body) : world_(world), bodies_{body} {
    for (std::size_t i = 0; i < bodies_.size(); ++i) add_joints_of(bodies_[i]);
    const Eigen::MatrixXd L_inverse = inverse_root_of_mass();
    W_ = L_inverse.transpose() * L_inverse;
    to_bias_ = Eigen::MatrixXd::Zero(size(), kRows * static_cast<Eigen::Index>(joints_.size()));
    if (joints_.empty()) return;
    const Eigen::MatrixXd A = jacobian() * L_inverse.transpose();  // J L⁻ᵀ with M = L Lᵀ.
    // Joints that close a loop are redundant.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition(A);
    const Eigen::MatrixXd A_plus = decomposition.pseudoInverse();
    W_ -= L_inverse.transpose() * (A_plus * A) * L_inverse;
    to_bias_ = -L_inverse.transpose() * A_plus;
    add_damping();
  }

  Matrix6 inverse_inertia(int body) const { return W_.block<6, 6>(row(body), row(body)); }

  Vector6 free_acceleration(int body) const {
    const Eigen::VectorXd bias_part = to_bias_ * bias();
    const Eigen::VectorXd a = W_ * free_forces(bias_part) + bias_part;
    return a.segment<6>(row(body));
  }

  double mobility(int joint) const {
    const Eigen::VectorXd force = along_axis(joint);
    return force.dot(W_ * force);
  }

 private:
  static constexpr int kRows = 6;  ///< Rows of a joint in J: some are zero.
  using JointRows = Eigen::Matrix<double, kRows, 6>;

  const JointDescription& joint(int index) const {
    return world_.description().joints[static_cast<std::size_t>(index)];
  }
  const BodyDescription& description(int body) const {
    return world_.description().bodies[static_cast<std::size_t>(body)];
  }
  bool moves(int body) const { return body != kNone && !description(body).fixed; }
  Eigen::Index size() const { return 6 * static_cast<Eigen::Index>(bodies_.size()); }
  /// First row of a body; kNone if it does not move.
  Eigen::Index row(int body) const {
    const auto found = std::ranges::find(bodies_, body);
    return found == bodies_.end() ? kNone : 6 * (found - bodies_.begin());
  }

  /// The solver takes damping by the velocity after the step of h: M + h c s sᵀ instead of M, for
  /// each axis s.
  void add_damping() {
    for (const int i : joints_) {
      const double impulse = world_.longest_step() * joint(i).damping;
      const Eigen::VectorXd axis = along_axis(i);
      const Eigen::VectorXd W_axis = W_ * axis;
      W_ -= impulse / (1 + impulse * axis.dot(W_axis)) * W_axis * W_axis.transpose();
    }
  }

  void add_joints_of(int body) {
    for (int i = 0; i < static_cast<int>(world_.description().joints.size()); ++i) {
      const int parent = joint(i).parent;
      const int child = joint(i).child;
      if ((parent != body && child != body) || std::ranges::count(joints_, i) > 0) continue;
      joints_.push_back(i);
      for (const int other : {parent, child}) {
        if (moves(other) && row(other) == kNone) bodies_.push_back(other);
      }
    }
  }

  Matrix3 inertia(int body) const {
    const Matrix3 R = world_.X_WB(body).R.toRotationMatrix();
    return world_.inertia_factor(body) * R * description(body).I_B * R.transpose();
  }

  Eigen::MatrixXd inverse_root_of_mass() const {
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size(), size());
    for (const int body : bodies_) {
      const Eigen::Index i = row(body);
      result.block<3, 3>(i, i).diagonal().setConstant(
          1 / std::sqrt(world_.inertia_factor(body) * description(body).mass));
      const Matrix3 L = inertia(body).llt().matrixL();
      result.block<3, 3>(i + 3, i + 3) =
          L.triangularView<Eigen::Lower>().solve(Matrix3::Identity());
    }
    return result;
  }

  /// Where a joint's child is against its parent; a parent that does not move is a body at the
  /// child that stands still.
  struct Joined {
    Vector3 axis_W;
    Vector3 r_child;  ///< Vector from the child's centre of mass to the joint's point, world.
    Vector3 r_parent;
    Twist V_child = Twist::Zero();
    Twist V_parent = Twist::Zero();
  };
  Joined joined(int index) const {
    const JointDescription& j = joint(index);
    const Pose X_WC = world_.X_WB(j.child);
    const Pose X_WJ = X_WC * description(j.child).X_WB.inverse() * j.X_WJ;
    Joined result;
    result.axis_W = X_WJ.R * j.axis_J;
    // Only what turns has a point of its own; the others hold at the child's.
    const bool turns = j.type == BodyJoint::kRevolute || j.type == BodyJoint::kBall;
    const Vector3 p_W = turns ? X_WJ.p : X_WC.p;
    result.r_child = p_W - X_WC.p;
    result.r_parent = j.parent == kNone ? Vector3::Zero() : Vector3(p_W - world_.X_WB(j.parent).p);
    result.V_child = world_.V_WB(j.child);
    if (j.parent != kNone) result.V_parent = world_.V_WB(j.parent);
    return result;
  }

  /// Projectors of the relative velocity at the joint's point, [linear; angular], on what the joint
  /// forbids.
  static std::pair<Matrix3, Matrix3> forbidden(BodyJoint type, const Vector3& axis_W) {
    const Matrix3 across = Matrix3::Identity() - axis_W * axis_W.transpose();
    const Matrix3 all = Matrix3::Identity();
    switch (type) {
      case BodyJoint::kRevolute:
        return {all, across};
      case BodyJoint::kPrismatic:
        return {across, all};
      case BodyJoint::kBall:
        return {all, Matrix3::Zero()};
      case BodyJoint::kFixed:
        break;
    }
    return {all, all};
  }

  /// Rows of the joints: P_l (v_c + ω_c × r_c − v_p − ω_p × r_p) = 0, P_a (ω_c − ω_p) = 0.
  Eigen::MatrixXd jacobian() const {
    Eigen::MatrixXd J =
        Eigen::MatrixXd::Zero(kRows * static_cast<Eigen::Index>(joints_.size()), size());
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const JointDescription& j = joint(joints_[k]);
      const Joined joined = this->joined(joints_[k]);
      const auto projectors = forbidden(j.type, joined.axis_W);
      const auto rows = [&projectors](const Vector3& r) {
        const auto& [linear, angular] = projectors;
        JointRows result = JointRows::Zero();
        result.topLeftCorner<3, 3>() = linear;
        result.topRightCorner<3, 3>() = -linear * skew(r);
        result.bottomRightCorner<3, 3>() = angular;
        return result;
      };
      const auto top = kRows * static_cast<Eigen::Index>(k);
      if (moves(j.child)) J.block<kRows, 6>(top, row(j.child)) = rows(joined.r_child);
      if (moves(j.parent)) J.block<kRows, 6>(top, row(j.parent)) = -rows(joined.r_parent);
    }
    return J;
  }

  /// J̇ v. P turns with the parent: Ṗ u = ω_p × P u − P (ω_p × u), of which P u = 0.
  Eigen::VectorXd bias() const {
    Eigen::VectorXd result(kRows * static_cast<Eigen::Index>(joints_.size()));
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const Joined joined = this->joined(joints_[k]);
      const auto [linear, angular] = forbidden(joint(joints_[k]).type, joined.axis_W);
      const Vector3 w_c = joined.V_child.tail<3>();
      const Vector3 w_p = joined.V_parent.tail<3>();
      const Vector3 v = joined.V_child.head<3>() + w_c.cross(joined.r_child) -
                        joined.V_parent.head<3>() - w_p.cross(joined.r_parent);
      // The parent's point stays with the child's: ṙ_p = v_c + ω_c × r_c − v_p.
      const Vector3 r_parent_dot =
          joined.V_child.head<3>() + w_c.cross(joined.r_child) - joined.V_parent.head<3>();
      const Vector3 centripetal =
          w_c.cross(w_c.cross(joined.r_child)) - w_p.cross(r_parent_dot) - w_p.cross(v);
      const Vector3 turning = -w_p.cross(w_c - w_p);
      result.segment<kRows>(kRows * static_cast<Eigen::Index>(k)) << linear * centripetal,
          angular * turning;
    }
    return result;
  }

  /// Generalised force of a unit along a joint's axis on the child, and on the parent.
  Eigen::VectorXd along_axis(int index) const {
    const JointDescription& j = joint(index);
    const Joined joined = this->joined(index);
    Eigen::VectorXd force = Eigen::VectorXd::Zero(size());
    const auto push = [&](int body, const Vector3& r, double sign) {
      if (!moves(body)) return;
      Wrench F = Wrench::Zero();
      if (j.type == BodyJoint::kRevolute) F.tail<3>() = sign * joined.axis_W;
      if (j.type == BodyJoint::kPrismatic) F << sign * joined.axis_W, sign * r.cross(joined.axis_W);
      force.segment<6>(row(body)) += F;
    };
    push(j.child, joined.r_child, 1);
    push(j.parent, joined.r_parent, -1);
    return force;
  }

  /// All but contacts. `bias_part`: the acceleration by the joints' bias alone.
  Eigen::VectorXd free_forces(const Eigen::VectorXd& bias_part) const {
    Eigen::VectorXd forces(size());
    for (const int body : bodies_) {
      const Vector3 w = world_.V_WB(body).tail<3>();
      const double heavy = description(body).weightless ? 0 : description(body).mass;
      forces.segment<6>(row(body)) << heavy * world_.description().gravity_W,
          -w.cross(inertia(body) * w);
    }
    for (const int i : joints_) {
      const Eigen::VectorXd axis = along_axis(i);
      const double rate = world_.joints().velocity(i) + world_.longest_step() * axis.dot(bias_part);
      forces += (world_.joints().spring_force(i) - joint(i).damping * rate) * axis;
    }
    return forces;
  }

  const World& world_;
  std::vector<int> bodies_;
  std::vector<int> joints_;
  Eigen::MatrixXd W_;
  Eigen::MatrixXd to_bias_;
};

}  // namespace

Mobility World::mobility_of(int body) const {
  const JointedGroup group(*this, body);
  return {group.inverse_inertia(body), group.free_acceleration(body)};
}

double World::joint_mobility(int joint) const {
  const JointDescription& description = description_.joints[at(joint)];
  const auto moves = [&](int body) { return body >= 0 && !description_.bodies[at(body)].fixed; };
  if (moves(description.child)) return JointedGroup(*this, description.child).mobility(joint);
  if (moves(description.parent)) return JointedGroup(*this, description.parent).mobility(joint);
  return 0;
}

}  // namespace hlm::ve
