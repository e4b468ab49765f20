// What the joints of a Bullet world leave of a body's mobility.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
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
/// part. Of longer chains the farther bodies are taken to stand still.
class JointedBodies {
 public:
  static constexpr std::size_t kMostBodies = 32;

  JointedBodies(btDynamicsWorld& world, btRigidBody& body) : bodies_{&body} {
    for (std::size_t i = 0; i < bodies_.size(); ++i) add_joints_of(world, *bodies_[i]);
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(size(), size());  // S S = M⁻¹.
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Eigen::SelfAdjointEigenSolver<Matrix6> mobility(free_mobility(*bodies_[i]));
      S.block<6, 6>(row(i), row(i)) = mobility.eigenvectors() *
                                      mobility.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
                                      mobility.eigenvectors().transpose();
    }
    root_ = S;
    acceleration_ = Eigen::VectorXd::Zero(size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      acceleration_.segment<3>(row(i)) =
          vector_of(bodies_[i]->getGravity())
              .cwiseProduct(vector_of(bodies_[i]->getLinearFactor()));
    }
    if (!joints_.empty()) hold_by_joints(S);
  }

  bool has_joints() const { return !joints_.empty(); }
  bool has(const btRigidBody& body) const { return find(body) < bodies_.size(); }

  /// Of one of the bodies, about its centre of mass, world axes: its block of
  /// M⁻¹ − M⁻¹Jᵀ (J M⁻¹ Jᵀ)⁺ J M⁻¹.
  Matrix6 inverse_inertia(const btRigidBody& body) const {
    const auto rows = root_.middleRows<6>(row(find(body)));
    return rows * rows.transpose();
  }

  /// Its acceleration by weight, and by what its joints make of it and of its velocity.
  Vector6 acceleration(const btRigidBody& body) const {
    return acceleration_.segment<6>(row(find(body)));
  }

 private:
  /// A row of the solver.
  struct Row {
    btVector3 linear_a, angular_a, linear_b, angular_b;
    btScalar error = 0, softness = 0, lower = -SIMD_INFINITY, upper = SIMD_INFINITY;
  };

  /// Takes from mobility and acceleration what the joints forbid: J a = -J̇ v.
  void hold_by_joints(const Eigen::MatrixXd& S) {
    constexpr double kAhead = 5e-3;  // s: less is lost in single precision.
    Eigen::VectorXd v(size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      v.segment<6>(row(i)) << vector_of(bodies_[i]->getLinearVelocity()),
          vector_of(bodies_[i]->getAngularVelocity());
    }
    const Eigen::MatrixXd J = jacobian(0);
    if (J.rows() == 0) return;
    const Eigen::MatrixXd after = jacobian(kAhead);
    const Eigen::MatrixXd before = jacobian(-kAhead);
    Eigen::VectorXd bias = Eigen::VectorXd::Zero(J.rows());  // J̇ v
    if (after.rows() == J.rows() && before.rows() == J.rows()) {
      bias = (after - before) * v / (2 * kAhead);
    }
    // What is heavy counts as much as what is light: rows of length 1.
    const Eigen::MatrixXd JS = J * S;
    const Eigen::VectorXd scale =
        JS.rowwise().norm().cwiseMax(std::numeric_limits<double>::min()).cwiseInverse();
    const Eigen::MatrixXd A = scale.asDiagonal() * JS;
    // Joints that close a loop are redundant, up to Bullet's single precision.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(1e-5);
    decomposition.compute(A);
    const Eigen::MatrixXd A_plus = decomposition.pseudoInverse();
    root_ -= S * A_plus * A;
    acceleration_ -= S * (A_plus * (scale.asDiagonal() * (J * acceleration_ + bias)));
  }

  std::size_t find(const btRigidBody& body) const {
    return static_cast<std::size_t>(std::ranges::find(bodies_, &body) - bodies_.begin());
  }

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
        if (moves(*other) && !has(*other) && bodies_.size() < kMostBodies) bodies_.push_back(other);
      }
    }
  }

  /// What the joints forbid, J v = 0, with the bodies where they are so much later, s; they are
  /// where they were again.
  Eigen::MatrixXd jacobian(double ahead) const {
    std::vector<btTransform> present;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      present.push_back(bodies_[i]->getWorldTransform());
      bodies_[i]->setWorldTransform(moved(*bodies_[i], ahead, i + 1));
    }
    std::vector<Eigen::RowVectorXd> rows;
    for (btTypedConstraint* const joint : joints_) add_rows(*joint, rows);
    for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i]->setWorldTransform(present[i]);
    for (btTypedConstraint* const joint : joints_) rows_of(*joint);  // They keep what they found.
    Eigen::MatrixXd J(static_cast<Eigen::Index>(rows.size()), size());
    for (std::size_t i = 0; i < rows.size(); ++i) J.row(static_cast<Eigen::Index>(i)) = rows[i];
    return J;
  }

  /// Each body a little off: an axis of a btGeneric6DofConstraint that is locked has a row only
  /// where it has an error.
  static btTransform moved(const btRigidBody& body, double ahead, std::size_t number) {
    const btScalar off = btScalar(1e-5) * static_cast<btScalar>(number);  // m, rad
    btTransform X;
    btTransformUtil::integrateTransform(body.getWorldTransform(), body.getLinearVelocity(),
                                        body.getAngularVelocity(), btScalar(ahead), X);
    X.setOrigin(X.getOrigin() + btVector3(off, off, off));
    X.setRotation(btQuaternion(btVector3(1, 1, 1), off) * X.getRotation());
    return X;
  }

  void add_rows(btTypedConstraint& joint, std::vector<Eigen::RowVectorXd>& rows) const {
    for (const Row& row : rows_of(joint)) {
      // Limits bear one way only, motors and friction up to a force.
      if (row.lower > -SIMD_INFINITY || row.upper < SIMD_INFINITY) continue;
      Eigen::RowVectorXd& J = rows.emplace_back(Eigen::RowVectorXd::Zero(size()));
      add(joint.getRigidBodyA(), row.linear_a, row.angular_a, J);
      add(joint.getRigidBodyB(), row.linear_b, row.angular_b, J);
    }
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
    if (!has(body)) return;
    const Eigen::Index first = row(find(body));
    J.segment<3>(first) += vector_of(linear).transpose();
    J.segment<3>(first + 3) += vector_of(angular).transpose();
  }

  std::vector<btRigidBody*> bodies_;  ///< That move.
  std::vector<btTypedConstraint*> joints_;
  Eigen::MatrixXd root_;          ///< root_ root_ᵀ is M⁻¹ as the joints leave it.
  Eigen::VectorXd acceleration_;  ///< m/s², rad/s², of each body, world axes.
};

}  // namespace hlm::bullet
