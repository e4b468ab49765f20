// Random states of tools that approach their contacts (docs/method.md 5).
#pragma once

#include <Eigen/QR>

#include "hlm/haptic_server/local_model/collision.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::test {

/// d×m: column i is J_iᵀ n_i.
using ContactNormals =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDof, server::kMaxCollisions>;

/// A state before the collision.
struct Case {
  MassMatrix mass;
  Eigen::LLT<MassMatrix> D;
  ContactNormals normals;
  Velocity v;
};

/// A random tool that approaches `count` random contacts.
inline Case random_case(Random& random, int links, int count) {
  ToolModel tool(random_tool(random, links, JointType::kFree));
  tool.set_configuration(random_configuration(random, tool));
  Case c{tool.mass_matrix(),
         {},
         ContactNormals(tool.dof(), count),
         random_velocity(random, tool.dof(), 1.0)};
  c.D.compute(c.mass);
  for (int i = 0; i < count; ++i) {
    const int link = random.integer(0, links - 1);
    const PointJacobian J = tool.point_jacobian(link, tool.X_WL(link) * random.vector(0.1));
    Vector3 n = random.direction();
    if (n.dot(J * c.v) > 0) n = -n;
    c.normals.col(i) = J.transpose() * n;
  }
  return c;
}

/// J_cᵀ p: the generalised impulse among constraints at rest.
inline GeneralisedForce collision_impulse(server::CollisionRule rule, const Case& c, double e) {
  const server::ImpulseColumns A = c.D.matrixL().solve(c.normals);
  const server::ContactNumbers w = (1 + e) * (c.normals.transpose() * c.v);
  return c.normals * collision_impulses(rule, A, w, server::kDistinctAngle);
}

inline double kinetic_energy(const Case& c, const Velocity& v) { return 0.5 * v.dot(c.mass * v); }

inline Velocity after(const Case& c, const GeneralisedForce& impulse) {
  return c.v + c.D.solve(impulse);
}

/// Eq. 11 with the m×m pseudo-inverse, as printed.
inline Eigen::VectorXd printed_impulse(const Case& c, double e) {
  const Eigen::MatrixXd J_c = c.normals.transpose();
  const Eigen::MatrixXd inverse_mass = c.mass.inverse();
  const Eigen::MatrixXd W = J_c * inverse_mass * J_c.transpose();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> cod;
  cod.setThreshold(1e-10);
  cod.compute(W);
  return -(1 + e) * (cod.pseudoInverse() * (J_c * c.v));
}

}  // namespace hlm::test
