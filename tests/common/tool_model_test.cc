// The tool model against MuJoCo, and against its own definitions by finite differences.
#include "hlm/common/tool_model.h"

#include "tests/support/catch.h"
#include "tests/support/mujoco_tool.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm {
namespace {

using test::Random;

TEST_CASE("Mass matrix, gravity and Jacobians equal MuJoCo's for every kind of root") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute,
                                  JointType::kPrismatic, JointType::kFixed);
  const int count = GENERATE(2, 3, 7);
  const ToolDescription tool = test::random_chain(random, count, root);
  REQUIRE(find_error(tool) == std::nullopt);
  ToolModel model(tool);
  test::MujocoTool reference(tool);

  for (int trial = 0; trial < 5; ++trial) {
    const Configuration q = test::random_configuration(random, model);
    model.set_configuration(q);
    reference.set_configuration(q);
    // kg·m², N·m and m, values up to 100. MuJoCo diagonalises inertias to about 1e-9.
    const double tolerance = 1e-8;
    CHECK((model.mass_matrix() - reference.mass_matrix()).cwiseAbs().maxCoeff() < tolerance);
    CHECK((model.gravity() - reference.gravity()).cwiseAbs().maxCoeff() < tolerance);
    const int link = random.integer(0, count - 1);
    const Vector3 p_W = model.X_WL(link) * random.vector(0.1);
    CHECK((model.jacobian(link, p_W) - reference.jacobian(link, p_W)).cwiseAbs().maxCoeff() <
          tolerance);
  }
}

TEST_CASE("The bias force equals MuJoCo's for every kind of root") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute,
                                  JointType::kPrismatic, JointType::kFixed);
  const int count = GENERATE(2, 3, 7);
  const ToolDescription tool = test::random_chain(random, count, root);
  ToolModel model(tool);
  test::MujocoTool reference(tool);

  for (int trial = 0; trial < 5; ++trial) {
    const Configuration q = test::random_configuration(random, model);
    const Velocity v = test::random_velocity(random, model.dof(), 5.0);  // m/s, rad/s
    model.set_configuration(q);
    reference.set_configuration(q);
    const GeneralisedForce expected = reference.bias_force(v) - reference.gravity();
    // N and N·m, values up to 1000; the tolerance of inertias above, times |q̇|².
    CHECK((model.bias_force(v) - expected).norm() < 1e-7 * (1 + expected.norm()));
  }
}

/// Σ_jk (∂D_ij/∂q_k - ½ ∂D_jk/∂q_i) q̇_j q̇_k: Christoffel's symbols from differences of D(q). Only
/// for coordinates whose rates are the velocities, that is without a free root.
GeneralisedForce christoffel_force(ToolModel model, const Velocity& v) {
  const double h = 1e-5;
  const Configuration q = model.configuration();
  GeneralisedForce c = GeneralisedForce::Zero(model.dof());
  for (int k = 0; k < model.dof(); ++k) {
    const auto mass_at = [&](double offset) {
      model.set_configuration(q + offset * Configuration::Unit(model.dof(), k));
      return model.mass_matrix();
    };
    const MassMatrix slope = (mass_at(h) - mass_at(-h)) / (2 * h);
    c += v[k] * (slope * v);
    c[k] -= 0.5 * v.dot(slope * v);
  }
  return c;
}

TEST_CASE("The bias force is that of Christoffel's symbols of D(q)") {
  Random random;
  const JointType root = GENERATE(JointType::kPlanar, JointType::kRevolute, JointType::kFixed);
  const ToolDescription chain = test::random_tool(random, GENERATE(2, 5, 8), root);
  ToolModel model(GENERATE(false, true) ? test::guided(random, chain) : chain);
  model.set_configuration(test::random_configuration(random, model) / 3);
  const Velocity v = test::random_velocity(random, model.dof(), 3.0);
  const GeneralisedForce expected = christoffel_force(model, v);
  CHECK((model.bias_force(v) - expected).norm() < 1e-7 * (1 + expected.norm()));  // N, N·m
}

TEST_CASE("The bias force takes as much power as a change of D(q) gives: q̇ᵀc = ½ q̇ᵀḊq̇") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute);
  const ToolDescription chain = test::random_tool(random, GENERATE(1, 2, 7), root);
  const bool has_curves = GENERATE(false, true) && chain.links.size() > 1;
  ToolModel model(has_curves ? test::guided(random, chain) : chain);
  const Configuration q = test::random_configuration(random, model);
  const Velocity v = test::random_velocity(random, model.dof(), 3.0);
  const double h = 1e-6;
  const auto energy_at = [&](double time) {
    model.set_configuration(model.integrate(q, v, time));
    return 0.5 * v.dot(model.mass_matrix() * v);
  };
  const double expected = (energy_at(h) - energy_at(-h)) / (2 * h);
  model.set_configuration(q);
  CHECK(v.dot(model.bias_force(v)) == Approx(expected).epsilon(1e-6).margin(1e-6));  // W
}

TEST_CASE("The hand Jacobian is the rate of the hand's pose") {
  Random random;
  const JointType root = GENERATE(JointType::kFree, JointType::kPlanar, JointType::kRevolute);
  const ToolDescription chain = test::random_tool(random, 5, root);
  ToolModel model(GENERATE(false, true) ? test::guided(random, chain) : chain);
  const Configuration q = test::random_configuration(random, model);
  const Velocity v = test::random_velocity(random, model.dof(), 1.0);
  const double dt = 1e-6;

  model.set_configuration(model.integrate(q, v, -dt));
  const Pose before = model.X_WH();
  model.set_configuration(model.integrate(q, v, dt));
  const Pose after = model.X_WH();
  model.set_configuration(q);

  const Twist expected = displacement(before, after) / (2 * dt);
  CHECK((model.hand_jacobian() * v - expected).norm() < 1e-6);  // m/s, rad/s
}

TEST_CASE("A mass matrix is that of the links' Jacobians, whatever shares a coordinate") {
  Random random;
  const ToolDescription tool = test::guided(random, test::random_tool(random, 7, JointType::kFree));
  REQUIRE(!find_error(tool));
  ToolModel model(tool);
  model.set_configuration(test::random_configuration(random, model));
  MassMatrix expected = MassMatrix::Zero(model.dof(), model.dof());
  for (int i = 0; i < model.links(); ++i) {
    const Link& link = tool.links[static_cast<std::size_t>(i)];
    const Jacobian J = model.jacobian(i, model.X_WL(i) * link.p_LCom);
    const Matrix3 R = model.X_WL(i).R.toRotationMatrix();
    Matrix6 inertia = Matrix6::Zero();
    inertia.topLeftCorner<3, 3>() = link.mass * Matrix3::Identity();
    inertia.bottomRightCorner<3, 3>() = R * link.I_LCom * R.transpose();
    expected += J.transpose() * inertia * J;
  }
  const int own = model.velocity_index(1);
  expected(own, own) += tool.curves[0].armature;
  CHECK((model.mass_matrix() - expected).norm() < 1e-12 * expected.norm());
}

TEST_CASE("Beyond its limits a curve goes on straight") {
  Random random;
  const ToolDescription tool = test::guided(random, test::random_tool(random, 2, JointType::kFree));
  const JointCurve& curve = tool.curves[0];
  const CurvePoint end = point_of(curve, -0.5, 0.5, 0.5);
  const CurvePoint beyond = point_of(curve, -0.5, 0.5, 0.6);
  CHECK((beyond.X_JL.p - end.X_JL.p - 0.1 * end.v_J).norm() < 1e-12);  // m
  CHECK(beyond.a_J.isZero(0));
}

TEST_CASE("Quaternions stay unit over a million steps") {
  Random random;
  ToolModel model(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  Configuration q = model.neutral();
  const Velocity v = test::random_velocity(random, 6, 20.0);
  for (int i = 0; i < 1'000'000; ++i) q = model.integrate(q, v, 1e-3);
  CHECK(std::abs(q.tail<4>().norm() - 1) < 1e-12);
}

TEST_CASE("A planar tool moves in its joint's plane, rotations about its normal") {
  ToolModel model(test::rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kPlanar));
  model.set_configuration(Configuration(Eigen::Vector3d(0.1, 0.2, 0.5)));
  CHECK((model.X_WH().p - Vector3(0.1, 0.2, 0)).norm() < 1e-15);
  CHECK((model.mass_matrix() - MassMatrix(Eigen::Vector3d(1, 1, 2e-3).asDiagonal())).norm() <
        1e-15);
}

}  // namespace
}  // namespace hlm
