// A gripper in the local model: its jaws along curves, and what drives them.
#include <array>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;      // s
constexpr double kReach = 0.1;    // m, from the palm to the jaws
constexpr double kTravel = 0.04;  // m, of each jaw

/// A palm that is free, and two jaws that one coordinate moves apart, along the world's y: q is how
/// far each is from the middle, m.
ToolDescription parallel_gripper() {
  ToolDescription tool = test::rigid_tool(0.2, 2e-4 * Matrix3::Identity());
  tool.length = 2 * kReach;
  for (std::uint8_t i = 1; i <= 2; ++i) {
    Link& jaw = tool.links.emplace_back();
    jaw.parent = 0;
    jaw.joint = i == 1 ? JointType::kGuided : JointType::kFollowing;
    jaw.mass = 0.02;
    jaw.I_LCom = 1e-5 * Matrix3::Identity();
    jaw.lower = 0;
    jaw.upper = kTravel;
    JointCurve& curve = tool.curves.emplace_back();
    curve.link = i;
    curve.leader = 1;
    const double side = i == 1 ? 1 : -1;
    curve.terms.col(0) << 0, side * kTravel / 2, -kReach, 1, 0, 0, 0;
    curve.terms.col(1) << 0, side * kTravel / 2, 0, 0, 0, 0, 0;
  }
  REQUIRE(!find_error(tool));
  return tool;
}

Configuration opened(double q) {
  Configuration configuration(8);
  configuration << 0, 0, 0, 1, 0, 0, 0, q;
  return configuration;
}

JointDrive servo(double target) {
  return {.link = 1,
          .target = target,
          .closed = 0,
          .open = kTravel,
          .stiffness = 2000,
          .damping = 20,
          .most = 30};
}

/// A wall of the world on which a jaw closes: its inner face is at y, the jaw's outside it.
ReportedContact wall(std::uint32_t jaw, double y) {
  ReportedContact contact;
  contact.identity = jaw;
  contact.a = {SideKind::kToolLink, jaw};
  contact.n_W = jaw == 1 ? Vector3::UnitY() : Vector3(-Vector3::UnitY());
  contact.p_WC = {0, jaw == 1 ? y : -y, -kReach};
  return contact;
}

/// The hand keeps the palm where it is.
HandInput still_hand(const LocalModel& model, std::optional<double> opening = {}) {
  HandInput hand;
  hand.stiffness << Vector3::Constant(5000), Vector3::Constant(20);
  hand.damping << Vector3::Constant(50), Vector3::Constant(0.2);
  const Pose X_WH = model.proxy().X_WH();
  hand.F = hand.stiffness.cwiseProduct(displacement(X_WH, Pose{})) -
           hand.damping.cwiseProduct(model.hand_twist());
  hand.opening = opening;
  return hand;
}

struct Bench {
  explicit Bench(double q, LocalModelParameters parameters = {})
      : model(parallel_gripper(), opened(q), parameters, kDt), q_VE(opened(q)) {}

  void update(const JointDrives& drives, const ReportedContacts& contacts = {}) {
    ReportedContacts placed = contacts;
    for (ReportedContact& contact : placed) {
      const double side = contact.a.index == 1 ? 1 : -1;
      contact.separation = side * (side * q_VE[7] - contact.p_WC.y());
    }
    model.adopt({.contacts = placed, .q_VE = q_VE, .drives = drives});
  }
  ContactWrench run(int steps, std::optional<double> opening = {}) {
    ContactWrench felt;
    for (int i = 0; i < steps; ++i) felt = model.step(still_hand(model, opening));
    return felt;
  }
  double q() const { return model.proxy().configuration()[7]; }

  LocalModel model;
  Configuration q_VE;
};

TEST_CASE("A servo takes the jaws to its target, and what leads them is the device's gripper",
          "[optimised]") {
  Bench bench(0.03);
  JointDrives drives{servo(0.01)};
  bench.update(drives);
  bench.run(1500);
  CHECK(bench.q() == Approx(0.01).margin(1e-6));  // m
  CHECK(bench.model.drives().grip() == 0);
  bench.run(1500, 0.75);
  CHECK(bench.q() == Approx(0.01).margin(1e-6));
  drives[0].follows_device = true;
  bench.update(drives);
  bench.run(1500, 0.75);
  CHECK(bench.q() == Approx(0.75 * kTravel).margin(1e-6));
  bench.run(1500);  // A device without a gripper.
  CHECK(bench.q() == Approx(0.01).margin(1e-6));
}

TEST_CASE("Jaws that close on something press as their servo does, and the hand feels nothing",
          "[optimised]") {
  const double target = GENERATE(0.012, 0.0);  // m: within the servo's force, and beyond it
  Bench bench(0.021);
  bench.update({servo(target)}, {wall(1, 0.02), wall(2, 0.02)});
  const ContactWrench felt = bench.run(3000);
  const double due = std::min(2000 * (bench.q() - target), 30.0);  // N
  INFO("q " << bench.q());
  CHECK(bench.model.drives().grip() == Approx(due).epsilon(1e-3));
  CHECK(felt.F.norm() < 1e-3);  // N
  double pressed = 0;
  for (const LocalContact& contact : bench.model.contacts()) {
    pressed += contact.latest.f_W.dot(contact.now.n_W);
  }
  CHECK(pressed == Approx(due).epsilon(1e-3));
}

TEST_CASE("The hand feels what pushes the jaws as a whole, whatever their servo bears",
          "[optimised]") {
  Bench bench(0.021);
  bench.update({servo(0.012)}, {wall(1, 0.02), wall(2, 0.02)});
  bench.run(2000);
  HandInput hand = still_hand(bench.model);
  ContactWrench felt;
  for (int i = 0; i < 2000; ++i) {
    hand = still_hand(bench.model);
    hand.F.y() += 3;  // N: towards one wall
    felt = bench.model.step(hand);
  }
  // What the coupling does not bear the walls do.
  const double bears = (hand.F + Wrench(hand.damping.cwiseProduct(bench.model.hand_twist()))).y();
  CHECK(felt.F.y() == Approx(-bears).margin(1e-3));  // N
  CHECK(bench.model.velocity().norm() < 1e-4);
}

TEST_CASE("Jaws stop at their limits, and a loose one goes where it is pushed") {
  Bench bench(0.01);
  bench.update({}, {wall(1, 0.01)});
  HandInput hand;
  hand.damping << Vector3::Constant(50), Vector3::Constant(0.2);
  for (int i = 0; i < 400; ++i) {  // The hand takes the palm along, and the wall keeps a jaw.
    hand.F = -hand.damping.cwiseProduct(bench.model.hand_twist());
    hand.F.y() -= 3;  // N: 60 mm/s
    bench.model.step(hand);
  }
  CHECK(bench.q() > 0.02);  // m
  bench.update({servo(0.06)});
  bench.run(2000);
  CHECK(bench.q() == Approx(kTravel).margin(1e-4));
  CHECK(bench.model.velocity().norm() < 1e-4);
}

TEST_CASE("A drive at its largest force is a constant force, and leaves it without a jump",
          "[optimised]") {
  Bench bench(0.021);
  bench.update({servo(0.0)}, {wall(1, 0.02), wall(2, 0.02)});
  bench.run(2000);
  double before = bench.model.drives().grip();
  double largest = 0;
  for (int i = 0; i < 400; ++i) {  // The target comes out of what it cannot reach.
    bench.update({servo(4e-5 * i)}, {wall(1, 0.02), wall(2, 0.02)});
    bench.run(1);
    largest = std::max(largest, std::abs(bench.model.drives().grip() - before));
    before = bench.model.drives().grip();
  }
  CHECK(largest < 0.3);  // N, in a step in which the target moves by 0.08 N
}

TEST_CASE("At its limit a jaw that touches nothing has no grip, whatever its coordinate's unit",
          "[optimised]") {
  const double upper = GENERATE(0.04, 1.0, 2.1, 255.0);  // for 40 mm
  ToolDescription tool = parallel_gripper();
  for (Link& jaw : tool.links) jaw.upper = jaw.parent < 0 ? jaw.upper : upper;
  const double ratio = upper / kTravel;
  LocalModel model(tool, opened(upper / 2), {}, kDt);
  const Configuration q_VE = opened(upper / 2);
  const double target = GENERATE(-0.5, 1.5) * upper;
  JointDrives drives{servo(target)};
  drives[0].stiffness /= ratio * ratio;
  drives[0].damping /= ratio * ratio;
  drives[0].most /= ratio;
  model.adopt({.contacts = {}, .q_VE = q_VE, .drives = drives});
  for (int i = 0; i < 2000; ++i) model.step(still_hand(model));
  REQUIRE(model.velocity().allFinite());
  const double end = target < 0 ? 0 : upper;
  CHECK(model.proxy().configuration()[7] == Approx(end).margin(1e-3 * upper));
  CHECK(model.drives().grip() == 0);
}

TEST_CASE("The device's gripper gets the virtual work of what it leads, each by its own stroke",
          "[optimised]") {
  Bench bench(0.021);
  JointDrive drive = servo(0.012);
  drive.follows_device = true;
  drive.closed = GENERATE(0.0, 0.03);
  drive.open = 0.03 - drive.closed;
  bench.update({drive}, {wall(1, 0.02), wall(2, 0.02)});
  const double closing = drive.closed < drive.open ? 0.4 : 0.6;
  bench.run(2000, closing);
  const DrivenJoints& drives = bench.model.drives();
  REQUIRE(std::abs(drives.grip()) > 1);
  const double along_q = drive.closed < drive.open ? drives.grip() : -drives.grip();
  CHECK(drives.opening_force() == Approx(along_q * (drive.open - drive.closed)));
  drive.follows_device = false;
  bench.update({drive}, {wall(1, 0.02), wall(2, 0.02)});
  bench.run(10);
  CHECK(bench.model.drives().opening_force() == 0);
}

}  // namespace
}  // namespace hlm::server
