// Limited stiffness (docs/method.md 4.5).
#include "hlm/haptic_server/local_model/stiffness_limit.h"

#include <limits>

#include <Eigen/Eigenvalues>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

/// Stiffness felt at the hand of a tool pressed down on `count` contacts under its centre, N/m.
double felt_stiffness(const LocalModelParameters& parameters, std::uint16_t count) {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, 1e-3);
  ReportedContacts contacts(count);
  for (std::uint16_t i = 0; i < count; ++i) contacts[i].identity = i;
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  HandInput hand;
  hand.F[2] = -5;
  for (int i = 0; i < 3000; ++i) model.step(hand);
  return 5 / -model.proxy().X_WH().p.z();
}

TEST_CASE("Without a limit c contacts feel c times as stiff as one") {
  LocalModelParameters parameters;
  parameters.max_stiffness_sum = std::numeric_limits<double>::infinity();
  CHECK(felt_stiffness(parameters, 8) == Approx(8 * 4000.0).epsilon(1e-3));
}

TEST_CASE("Up to 4 contacts add up, and any more feel as 4 do", "[optimised]") {
  CHECK(felt_stiffness({}, 1) == Approx(4000).epsilon(1e-3));
  CHECK(felt_stiffness({}, 4) == Approx(4 * 4000).epsilon(1e-3));
  CHECK(felt_stiffness({}, 16) == Approx(4 * 4000).epsilon(1e-3));
  CHECK(felt_stiffness({}, 64) == Approx(4 * 4000).epsilon(1e-3));
}

TEST_CASE("The stiffness felt at the hand stays at its limit however many contacts there are",
          "[optimised]") {
  LocalModelParameters parameters;
  parameters.max_hand_stiffness = 6000;  // N/m
  CHECK(felt_stiffness(parameters, 1) == Approx(4000).epsilon(1e-3));
  CHECK(felt_stiffness(parameters, 8) == Approx(6000).epsilon(1e-3));
  CHECK(felt_stiffness(parameters, 64) == Approx(6000).epsilon(1e-3));
}

TEST_CASE("The stiffness at the hand is that of all contacts, on whichever links they are") {
  test::Random random;
  for (int trial = 0; trial < 200; ++trial) {
    const ToolDescription description = test::random_tool(
        random, random.integer(1, 5), trial % 2 == 0 ? JointType::kFree : JointType::kPlanar);
    ToolModel tool(description);
    tool.set_configuration(test::random_configuration(random, tool));
    const Velocity v = Velocity::Zero(tool.dof());
    const FrameMotions frames(tool, &v, {}, 1e-3);
    const Eigen::LLT<MassMatrix> D(tool.mass_matrix());
    const HandMap H = hand_map(tool, D, tool.hand_jacobian());

    LocalContacts contacts;
    Matrix3 per_k = Matrix3::Zero();  // Of the hand's force, N/m for each N/m.
    for (int i = random.integer(0, 12); i-- > 0;) {
      LocalContact& contact = contacts.emplace_back();
      contact.now.n_W = random.direction();
      contact.now.p_W = random.vector(0.2);  // m
      contact.a.index = static_cast<std::uint32_t>(random.integer(0, tool.links() - 1));
      contact.frame_a = frame_of_link(contact.a.index);
      Velocity along =
          tool.point_jacobian(static_cast<int>(contact.a.index), contact.now.p_W).transpose() *
          contact.now.n_W;
      if (random.integer(0, 1) == 1) {  // The tool with itself.
        contact.b = {SideKind::kToolLink,
                     static_cast<std::uint32_t>(random.integer(0, tool.links() - 1))};
        contact.frame_b = frame_of_link(contact.b.index);
        along -=
            tool.point_jacobian(static_cast<int>(contact.b.index), contact.now.p_W).transpose() *
            contact.now.n_W;
      }
      const Vector3 f = H.topRows<3>() * along;
      per_k += f * f.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(per_k);
    const double due = std::min(1.0, 4 / std::max(1e-9, eigen.eigenvalues().maxCoeff()));
    StiffnessLimit limit;
    CHECK(limit.scale(tool, contacts, frames, D, H, {}) == Approx(due).epsilon(1e-9));
  }
}

TEST_CASE("The natural frequency on the contacts stays at its limit") {
  LocalModelParameters parameters;
  parameters.max_stiffness_sum = std::numeric_limits<double>::infinity();
  parameters.max_contact_frequency = 100;  // rad/s: 1e4 N/m on 1 kg
  CHECK(felt_stiffness(parameters, 8) == Approx(1e4).epsilon(1e-3));
}

}  // namespace
}  // namespace hlm::server
