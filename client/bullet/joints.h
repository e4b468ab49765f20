// What the joints of a Bullet world leave of a body's mobility.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/world_shapes.h"
#include "hlm/common/spatial.h"

namespace hlm::bullet {

inline Matrix3 matrix_of(const btMatrix3x3& m) {
  Matrix3 result;
  for (int i = 0; i < 3; ++i) result.row(i) = vector_of(m[i]);
  return result;
}

/// The bodies that joints connect with one, and the directions that these forbid, as Bullet's
/// solver has them: any btTypedConstraint. Motors, friction, springs and limits of joints take no
/// part.
class JointedBodies {
 public:
  JointedBodies(btDynamicsWorld& world, btRigidBody& body) : bodies_{&body} {
    for (std::size_t i = 0; i < bodies_.size(); ++i) add_joints_of(world, *bodies_[i]);
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(size(), size());  // S S = M⁻¹.
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Eigen::SelfAdjointEigenSolver<Matrix6> mobility(free_mobility(*bodies_[i]));
      S.block<6, 6>(row(i), row(i)) = mobility.eigenvectors() *
                                      mobility.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
                                      mobility.eigenvectors().transpose();
    }
    const Eigen::MatrixXd J = jacobian();
    root_ = S;
    to_bias_ = Eigen::MatrixXd::Zero(size(), J.rows());
    if (J.rows() == 0) return;
    // Joints that close a loop are redundant, up to Bullet's single precision.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(1e-5);
    const Eigen::MatrixXd A = J * S;
    decomposition.compute(A);
    const Eigen::MatrixXd A_plus = decomposition.pseudoInverse();
    root_ -= S * A_plus * A;
    to_bias_ = S * A_plus;
  }

  bool has_joints() const { return !joints_.empty(); }

  /// Of the body itself, about its centre of mass, world axes: M⁻¹ − M⁻¹Jᵀ (J M⁻¹ Jᵀ)⁺ J M⁻¹.
  Matrix6 inverse_inertia() const { return root_.topRows<6>() * root_.topRows<6>().transpose(); }

  /// Its acceleration by weight, and by what its joints make of it and of its velocity.
  Vector6 acceleration() const {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      g.segment<3>(row(i)) = vector_of(bodies_[i]->getGravity())
                                 .cwiseProduct(vector_of(bodies_[i]->getLinearFactor()));
    }
    if (joints_.empty()) return g.head<6>();
    const Eigen::VectorXd free = g - to_bias_ * (jacobian() * g);
    return (free - to_bias_ * bias()).head<6>();
  }

 private:
  /// A row of the solver.
  struct Row {
    btVector3 linear_a, angular_a, linear_b, angular_b;
    btScalar error = 0, softness = 0, lower = -SIMD_INFINITY, upper = SIMD_INFINITY;
  };

  static bool moves(const btRigidBody& body) { return body.getInvMass() > 0; }
  static Matrix6 free_mobility(const btRigidBody& body) {
    const Vector3 moves = vector_of(body.getLinearFactor());
    const Vector3 turns = vector_of(body.getAngularFactor());
    Matrix6 W = Matrix6::Zero();
    W.topLeftCorner<3, 3>() = (double{body.getInvMass()} * moves.cwiseAbs2()).asDiagonal();
    W.bottomRightCorner<3, 3>() =
        turns.asDiagonal() * matrix_of(body.getInvInertiaTensorWorld()) * turns.asDiagonal();
    return W;
  }

  Eigen::Index size() const { return 6 * static_cast<Eigen::Index>(bodies_.size()); }
  static Eigen::Index row(std::size_t body) { return 6 * static_cast<Eigen::Index>(body); }

  void add_joints_of(btDynamicsWorld& world, const btRigidBody& body) {
    for (int i = 0; i < world.getNumConstraints(); ++i) {
      btTypedConstraint* const joint = world.getConstraint(i);
      const bool is_of_body = &joint->getRigidBodyA() == &body || &joint->getRigidBodyB() == &body;
      if (!is_of_body || !joint->isEnabled()) continue;
      if (std::ranges::find(joints_, joint) != joints_.end()) continue;
      joints_.push_back(joint);
      for (btRigidBody* other : {&joint->getRigidBodyA(), &joint->getRigidBodyB()}) {
        if (moves(*other) && std::ranges::find(bodies_, other) == bodies_.end()) {
          bodies_.push_back(other);
        }
      }
    }
  }

  /// What the joints forbid in the present poses: J v = 0.
  Eigen::MatrixXd jacobian() const {
    std::vector<Eigen::RowVectorXd> rows;
    for (btTypedConstraint* const joint : joints_) {
      for (const Row& row : rows_of(*joint)) {
        // Limits bear one way only, motors and friction up to a force.
        if (row.lower > -SIMD_INFINITY || row.upper < SIMD_INFINITY) continue;
        Eigen::RowVectorXd& J = rows.emplace_back(Eigen::RowVectorXd::Zero(size()));
        add(joint->getRigidBodyA(), row.linear_a, row.angular_a, J);
        add(joint->getRigidBodyB(), row.linear_b, row.angular_b, J);
      }
    }
    Eigen::MatrixXd J(static_cast<Eigen::Index>(rows.size()), size());
    for (std::size_t i = 0; i < rows.size(); ++i) J.row(static_cast<Eigen::Index>(i)) = rows[i];
    return J;
  }

  static std::vector<Row> rows_of(btTypedConstraint& joint) {
    joint.buildJacobian();
    btTypedConstraint::btConstraintInfo1 count{};
    joint.getInfo1(&count);
    std::vector<Row> rows(static_cast<std::size_t>(std::max(0, count.m_numConstraintRows)));
    if (rows.empty()) return rows;
    for (Row& row : rows) {
      row.linear_a.setZero();
      row.angular_a.setZero();
      row.linear_b.setZero();
      row.angular_b.setZero();
    }
    btTypedConstraint::btConstraintInfo2 info{};
    info.fps = 60;
    info.erp = btScalar(0.2);
    info.rowskip = static_cast<int>(sizeof(Row) / sizeof(btScalar));
    info.m_J1linearAxis = rows[0].linear_a;
    info.m_J1angularAxis = rows[0].angular_a;
    info.m_J2linearAxis = rows[0].linear_b;
    info.m_J2angularAxis = rows[0].angular_b;
    info.m_constraintError = &rows[0].error;
    info.cfm = &rows[0].softness;
    info.m_lowerLimit = &rows[0].lower;
    info.m_upperLimit = &rows[0].upper;
    info.m_damping = 1;
    joint.getInfo2(&info);
    return rows;
  }

  void add(const btRigidBody& body, const btVector3& linear, const btVector3& angular,
           Eigen::RowVectorXd& J) const {
    const auto found = std::ranges::find(bodies_, &body);
    if (found == bodies_.end()) return;
    const Eigen::Index first = row(static_cast<std::size_t>(found - bodies_.begin()));
    J.segment<3>(first) += vector_of(linear).transpose();
    J.segment<3>(first + 3) += vector_of(angular).transpose();
  }

  /// J̇ v, by the rows a little later; the bodies are where they were again.
  Eigen::VectorXd bias() const {
    constexpr double kAhead = 1e-2;  // s: less is lost in single precision.
    Eigen::VectorXd v(size());
    std::vector<btTransform> before;
    const Eigen::MatrixXd J = jacobian();
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      btRigidBody& body = *bodies_[i];
      v.segment<6>(row(i)) << vector_of(body.getLinearVelocity()),
          vector_of(body.getAngularVelocity());
      before.push_back(body.getWorldTransform());
      btTransform ahead;
      btTransformUtil::integrateTransform(before.back(), body.getLinearVelocity(),
                                          body.getAngularVelocity(), btScalar(kAhead), ahead);
      body.setWorldTransform(ahead);
    }
    const Eigen::MatrixXd J_ahead = jacobian();
    for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i]->setWorldTransform(before[i]);
    jacobian();  // Joints keep what they found where they are.
    if (J_ahead.rows() != J.rows()) return Eigen::VectorXd::Zero(J.rows());  // A limit comes near.
    return (J_ahead - J) * v / kAhead;
  }

  std::vector<btRigidBody*> bodies_;  ///< That move; the first one is the one in question.
  std::vector<btTypedConstraint*> joints_;
  Eigen::MatrixXd root_;     ///< root_ root_ᵀ is M⁻¹ as the joints leave it.
  Eigen::MatrixXd to_bias_;  ///< From J̇ v to the acceleration that it takes.
};

}  // namespace hlm::bullet
