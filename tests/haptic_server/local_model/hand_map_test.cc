// The wrench at the hand (docs/method.md 4.4, Eq. 8).
#include "hlm/haptic_server/local_model/hand_map.h"

#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

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
  const HandMap H = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());

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

/// Links of 0.2 m along x, boxes of 20 mm across, turning about `axes` in turn; held at the end.
ToolDescription chain_of(int count, JointType root, const std::vector<Vector3>& axes) {
  ToolDescription tool;
  for (int i = 0; i < count; ++i) {
    Link link;
    link.parent = i - 1;
    link.joint = i == 0 ? root : JointType::kRevolute;
    link.axis = axes[static_cast<std::size_t>(i) % axes.size()];
    if (i > 0) link.X_PJ.p = {0.2, 0, 0};
    link.p_LCom = {0.1, 0, 0};
    link.mass = 0.4;
    link.I_LCom = test::box_inertia(link.mass, {0.1, 0.01, 0.01});
    tool.links.push_back(link);
  }
  tool.hand_link = count - 1;
  tool.X_LH.p = {0.2, 0, 0};
  tool.length = 0.2 * count;
  return tool;
}
const std::vector<Vector3> kPlanarAxes{Vector3::UnitZ()};
const std::vector<Vector3> kSpatialAxes{Vector3::UnitZ(), Vector3::UnitY(), Vector3::UnitX()};

ToolModel in_posture(const ToolDescription& description, const Configuration& q) {
  ToolModel tool(description);
  tool.set_configuration(q);
  return tool;
}

TEST_CASE("With fewer than six degrees of freedom the wrench still gives the generalised force") {
  Random random;
  const double bend = random.uniform(0.5, 2.5);  // rad
  const ToolModel tool = GENERATE_COPY(in_posture(chain_of(1, JointType::kRevolute, kPlanarAxes),
                                                  Configuration(Eigen::Matrix<double, 1, 1>(bend))),
                                       in_posture(chain_of(2, JointType::kRevolute, kPlanarAxes),
                                                  Configuration(Eigen::Vector2d(0.3, bend))),
                                       in_posture(chain_of(3, JointType::kRevolute, kPlanarAxes),
                                                  Configuration(Eigen::Vector3d(0.3, 1.5, 1.0))));
  const HandMap H = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());
  const GeneralisedForce tau = test::random_velocity(random, tool.dof(), 10);
  CHECK((tool.hand_jacobian().transpose() * (H * tau) - tau).norm() < 1e-8);  // N, N·m
}

TEST_CASE("A planar tool's wrench stays in its plane") {
  ToolModel tool(test::rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kPlanar));
  const HandMap H = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());
  const Wrench F = H * GeneralisedForce(Eigen::Vector3d(1, 2, 0.3));
  Wrench expected;
  expected << 1, 2, 0, 0, 0, 0.3;
  CHECK((F - expected).norm() < 1e-12);
}

TEST_CASE("A redundant linkage feels the dynamically consistent wrench") {
  Random random;
  const ToolDescription chain = chain_of(2, JointType::kFree, kSpatialAxes);
  ToolModel tool(chain);
  tool.set_configuration(test::random_configuration(random, tool));
  const Eigen::MatrixXd D = tool.mass_matrix();
  const Eigen::MatrixXd J_h = tool.hand_jacobian();
  const Eigen::MatrixXd lambda = (J_h * D.inverse() * J_h.transpose()).inverse();
  const GeneralisedForce tau = test::random_velocity(random, tool.dof(), 10);

  const HandMap H = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());
  const Wrench expected = lambda * J_h * D.inverse() * tau;
  CHECK((H * tau - expected).norm() < 1e-9 * expected.norm());
}

/// Largest |force|² + |torque/length|² at the hand, square root, that 1 N at p_W on the link gives.
double felt_of_1_N(const ToolModel& tool, const HandMap& H, int link, const Vector3& p_W) {
  const double length = tool.description().length;
  Vector6 scale;
  scale << 1, 1, 1, 1 / length, 1 / length, 1 / length;
  const Eigen::Matrix<double, 6, 3> felt =
      scale.asDiagonal() * (H * tool.point_jacobian(link, p_W).transpose());
  return std::sqrt((felt.transpose() * felt).eigenvalues().real().maxCoeff());
}

TEST_CASE("In no posture does a linkage feel more than three times its contact forces",
          "[optimised]") {
  Random random;
  double largest = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const int links = random.integer(2, 9);
    const JointType root = static_cast<JointType>(random.integer(1, 4));
    ToolDescription chain = test::random_tool(random, links, root);
    std::vector<Vector3> half_sizes;
    for (int i = 0; i < links; ++i) {
      Link& link = chain.links[static_cast<std::size_t>(i)];
      link.parent = i - 1;
      half_sizes.emplace_back(random.uniform(0.01, 0.1), random.uniform(0.01, 0.1),
                              random.uniform(0.01, 0.1));
      link.I_LCom = test::box_inertia(link.mass, half_sizes.back());
    }
    chain.hand_link = links - 1;
    chain.length = 0.3;
    ToolModel tool(chain);
    tool.set_configuration(test::random_configuration(random, tool));
    const HandMap H = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());
    for (int i = 0; i < links; ++i) {
      const auto corner = static_cast<std::size_t>(i);
      const Vector3 sides(random.integer(0, 1) * 2 - 1, random.integer(0, 1) * 2 - 1,
                          random.integer(0, 1) * 2 - 1);
      const Vector3 p_W =
          tool.X_WL(i) * (chain.links[corner].p_LCom + half_sizes[corner].cwiseProduct(sides));
      largest = std::max(largest, felt_of_1_N(tool, H, i, p_W));
    }
  }
  CAPTURE(largest);
  CHECK(largest < 3);    // N
  CHECK(largest > 1.5);  // N: singular postures were among them.
}

TEST_CASE("An arm that swings through its stretched posture over a post feels no jump") {
  // The post pushes the middle link sideways at its middle.
  const ToolDescription arm = chain_of(3, JointType::kRevolute, kPlanarAxes);
  const double step = 1e-3;  // rad: a joint at 1 rad/s in 1 ms
  Wrench before = Wrench::Zero();
  double largest_jump = 0;
  double largest_force = 0;
  for (double bend = -1; bend <= 1; bend += step) {
    const ToolModel tool = in_posture(arm, Configuration(Eigen::Vector3d(0, bend, -2 * bend)));
    const Vector3 force = tool.X_WL(1).R * Vector3(0, 3.2, 0);  // N
    const GeneralisedForce tau =
        tool.point_jacobian(1, tool.X_WL(1) * Vector3(0.1, 0, 0)).transpose() * force;
    const Wrench felt = hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian()) * tau;
    if (bend > -1) largest_jump = std::max(largest_jump, (felt - before).head<3>().norm());
    largest_force = std::max(largest_force, felt.head<3>().norm());
    before = felt;
  }
  CHECK(largest_force < 3 * 3.2);  // N
  CHECK(largest_jump < 0.03);      // N
}

}  // namespace
}  // namespace hlm::server
