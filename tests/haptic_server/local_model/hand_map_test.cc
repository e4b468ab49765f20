// The wrench at the hand (docs/method.md 4.4, Eq. 8).
#include "haptic_server/local_model/hand_map.h"

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using test::Random;

TEST_CASE("A rigid tool held at its centre of mass feels the plain sum of contact wrenches") {
  Random random;
  ToolModel tool(test::rigid_tool(0.7, test::random_inertia(random, 0.05)));
  tool.set_configuration(test::random_configuration(random, tool));
  const HandMap H = hand_map(tool.mass_matrix().llt(), tool.hand_jacobian(), 0.1);

  GeneralisedForce tau = GeneralisedForce::Zero(6);
  Wrench sum = Wrench::Zero();
  for (int i = 0; i < 5; ++i) {
    const Vector3 p_W = tool.X_WL(0) * random.vector(0.1);
    const Vector3 f = random.vector(10);
    tau += tool.point_jacobian(0, p_W).transpose() * f;
    sum.head<3>() += f;
    sum.tail<3>() += (p_W - tool.X_WH().p).cross(f);
  }
  CHECK((H * tau - sum).norm() < 1e-9);  // N, N·m
}

TEST_CASE("With fewer than six degrees of freedom the wrench still gives the generalised force") {
  Random random;
  const int links = GENERATE(1, 3, 5);
  const JointType root = GENERATE(JointType::kPlanar, JointType::kRevolute);
  ToolModel tool(test::random_tool(random, links, root));
  if (tool.dof() > 6) return;
  tool.set_configuration(test::random_configuration(random, tool));
  // Every joint must reach the hand: the hand is on the last link of a chain.
  ToolDescription chain = tool.description();
  for (int i = 1; i < links; ++i) chain.links[static_cast<std::size_t>(i)].parent = i - 1;
  chain.hand_link = links - 1;
  ToolModel model(chain);
  model.set_configuration(tool.configuration());

  const Jacobian J_h = model.hand_jacobian();
  const HandMap H = hand_map(model.mass_matrix().llt(), J_h, chain.length);
  const GeneralisedForce tau = test::random_velocity(random, model.dof(), 10);
  CHECK((J_h.transpose() * (H * tau) - tau).norm() < 1e-8);  // N, N·m
}

TEST_CASE("A planar tool's wrench stays in its plane") {
  ToolModel tool(test::rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kPlanar));
  const HandMap H = hand_map(tool.mass_matrix().llt(), tool.hand_jacobian(), 0.1);
  const Wrench F = H * GeneralisedForce(Eigen::Vector3d(1, 2, 0.3));
  Wrench expected;
  expected << 1, 2, 0, 0, 0, 0.3;
  CHECK((F - expected).norm() < 1e-12);
}

TEST_CASE("A redundant linkage feels the dynamically consistent wrench") {
  Random random;
  ToolDescription chain = test::random_tool(random, 9, JointType::kRevolute);
  for (int i = 1; i < 9; ++i) {
    chain.links[static_cast<std::size_t>(i)].parent = i - 1;
    chain.links[static_cast<std::size_t>(i)].joint = JointType::kRevolute;
  }
  chain.hand_link = 8;
  ToolModel tool(chain);
  tool.set_configuration(test::random_configuration(random, tool));
  const Eigen::MatrixXd D = tool.mass_matrix();
  const Eigen::MatrixXd J_h = tool.hand_jacobian();
  const Eigen::MatrixXd lambda = (J_h * D.inverse() * J_h.transpose()).inverse();
  const GeneralisedForce tau = test::random_velocity(random, 9, 10);

  const HandMap H = hand_map(tool.mass_matrix().llt(), tool.hand_jacobian(), 0.1);
  const Wrench expected = lambda * J_h * D.inverse() * tau;
  CHECK((H * tau - expected).norm() < 1e-6 * expected.norm());
}

}  // namespace
}  // namespace hlm::server
