// Bodies that joints connect, as the hand holds them (docs/method.md 21).
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/placed_shape.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;     // s
constexpr double kGravity = 9.81;  // m/s²
constexpr double kEdge = 0.04;     // m, of each cube, of 0.3 kg
constexpr double kMass = 0.3;

BodyInertia cube(std::uint32_t body, double gravity = 0) {
  const double moment = kMass * kEdge * kEdge / 6;
  return {.body = body,
          .mass = kMass,
          .I_BCom = moment * Matrix3::Identity(),
          .gravity_W = {0, 0, -gravity}};
}

BodyPose at(std::uint32_t body, const Vector3& p) {
  return {.body = body, .X_WB = {p, Quaternion::Identity()}};
}

/// Cubes as the environment reports them, and a tool of 40 mm that a hand moves along z above them.
class Hand {
 public:
  Hand(const std::vector<BodyInertia>& inertias, const std::vector<BodyJoint>& joints,
       const std::vector<BodyPose>& poses, const Vector3& p_WTool)
      : tool_(test::rigid_tool(0.1, Matrix3::Identity() * 1e-4)) {
    std::vector<PlacedShape> shapes{
        test::rough_box(Vector3::Constant(kEdge), {SideKind::kToolLink, 0})};
    for (const BodyInertia& inertia : inertias) {
      shapes.push_back(
          test::rough_box(Vector3::Constant(kEdge), {SideKind::kMovableBody, inertia.body}));
    }
    scene_ = std::make_unique<Scene>(std::move(shapes),
                                     std::span<const std::pair<std::uint32_t, std::uint32_t>>(),
                                     tool_, inertias, joints);
    Configuration q = ToolModel(tool_).neutral();
    q.head<3>() = p_WTool;
    model_ = std::make_unique<LocalModel>(tool_, q, LocalModelParameters(), kStep);
    model_->set_scene(scene_.get());
    for (const BodyPose& pose : poses) poses_.push_back(pose);
    model_->adopt(
        {.contacts = ReportedContacts(), .q_VE = model_->proxy().configuration(), .poses = poses_});
  }

  /// Steps under a force on the tool, N, which keeps its rotation. Returns the force of its
  /// contacts in the latest one.
  Vector3 push(const Vector3& force, int count) {
    Vector3 felt = Vector3::Zero();
    for (int i = 0; i < count; ++i) {
      HandInput hand;
      hand.stiffness.tail<3>().setConstant(50);
      hand.damping << Vector3::Constant(5), Vector3::Constant(0.05);
      hand.F = -hand.damping.cwiseProduct(model_->hand_twist());
      hand.F.tail<3>() -= 50 * rotation_vector(model_->proxy().X_WH().R);
      hand.F.head<3>() += force;
      felt = model_->step(hand).F.head<3>();
    }
    return felt;
  }
  LocalModel& model() { return *model_; }
  const LocalBody& body(std::uint32_t id) const {
    const auto found = std::ranges::find(model_->bodies(), id, &LocalBody::id);
    REQUIRE(found != model_->bodies().end());
    return *found;
  }

 private:
  ToolDescription tool_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<LocalModel> model_;
  BodyPoses poses_;
};

/// A cube at the origin that moves along z, or turns about y at x = -0.2 m, with the tool on it.
BodyJoint slide() { return {.body = 1, .type = JointType::kPrismatic}; }
BodyJoint hinge() {
  const Pose joint{{-0.2, 0, 0}, Quaternion::Identity()};
  return {.body = 1, .X_PJ = joint, .X_BJ = joint, .axis = {0, 1, 0}};
}
Hand on(const BodyJoint& joint) {
  return {{cube(1)}, {joint}, {at(1, Vector3::Zero())}, {0, 0, kEdge}};
}

TEST_CASE("A button on its spring gives way by the hand's force, from 100 to 10000 N/m",
          "[optimised]") {
  for (const double stiffness : {100.0, 300.0, 1000.0, 10000.0}) {
    BodyJoint joint = slide();
    joint.stiffness = stiffness;
    joint.damping = 1;
    Hand hand = on(joint);
    const Vector3 felt = hand.push({0, 0, -2}, 3000);
    CHECK(felt.z() == Approx(2).epsilon(1e-3));                              // N
    CHECK(hand.body(1).X_WB.p.z() == Approx(-2 / stiffness).epsilon(1e-3));  // m
    CHECK(hand.body(1).X_WB.p.head<2>().norm() < 1e-9);
  }
}

TEST_CASE("A joint's stop bears the hand, and lets go of it", "[optimised]") {
  BodyJoint joint = GENERATE(slide(), hinge());
  const bool turns = joint.type == JointType::kRevolute;
  joint.lower = turns ? -1 : 0;
  joint.upper = turns ? 0 : 1;
  Hand hand = on(joint);
  hand.push({0, 0, -1.57}, 1500);
  const Vector3 felt = hand.push({0, 0, -1.57}, 1);
  CHECK(felt.z() == Approx(1.57).epsilon(1e-3));
  CHECK(std::abs(hand.body(1).X_WB.p.z()) < 2e-5);  // m
  // Away from the stop it moves freely: the tool alone is pulled.
  CHECK(hand.push({0, 0, 1.57}, 100).norm() < 1e-9);
}

TEST_CASE("What dry friction holds stays below it, and slides at it", "[optimised]") {
  BodyJoint joint = slide();
  joint.friction = 1;
  Hand hand = on(joint);
  CHECK(hand.push({0, 0, -0.9}, 2000).z() == Approx(0.9).epsilon(1e-3));
  CHECK(std::abs(hand.body(1).X_WB.p.z()) < 1e-4);  // m
  // 0.1 N are left, which the hand's damping of 5 N·s/m bears at 0.02 m/s.
  CHECK(hand.push({0, 0, -1.1}, 2000).z() == Approx(1).epsilon(1e-3));
  CHECK(hand.body(1).V_W.z() == Approx(-0.02).epsilon(0.01));
  CHECK(hand.push({0, 0, -0.9}, 1000).z() == Approx(0.9).epsilon(1e-3));
  CHECK(std::abs(hand.body(1).V_W.z()) < 1e-6);
}

TEST_CASE(
    "Dry friction moves nothing that is taken at rest, and stops what slides without a spring "
    "back") {
  BodyJoint joint = slide();
  joint.friction = 3;
  BodyPose pose = at(1, Vector3::Zero());
  pose.V_W[2] = GENERATE(1e-9, -1e-9, 0.05);  // m/s
  CAPTURE(pose.V_W[2]);
  Hand hand({cube(1)}, {joint}, {pose}, {0, 0, kEdge});
  double lowest = 0;
  double highest = 0;
  for (int i = 0; i < 200; ++i) {
    hand.push({0, 0, -0.1}, 1);
    lowest = std::min(lowest, hand.body(1).X_WB.p.z());
    highest = std::max(highest, hand.body(1).X_WB.p.z());
  }
  const double way = 0.3 * pose.V_W[2] * pose.V_W[2] / (2 * 3);  // m, of braking
  CHECK(lowest > -5e-6);
  CHECK(highest < way + 5e-5);
  CHECK(hand.body(1).X_WB.p.z() == Approx(highest).margin(1e-5));
}

TEST_CASE("What joints connect is held as a whole, and given back as a whole") {
  // Three cubes in a row, free, with hinges between them; the tool lifts none but rests on the
  // first.
  std::vector<BodyInertia> inertias{cube(1), cube(2), cube(3)};
  std::vector<BodyJoint> joints;
  std::vector<BodyPose> poses;
  for (std::uint32_t i = 1; i <= 3; ++i) {
    poses.push_back(at(i, {1.5 * kEdge * (i - 1), 0, 0}));
    if (i == 1) continue;
    joints.push_back({.body = i,
                      .parent = i - 1,
                      .X_PJ = {{0.75 * kEdge, 0, 0}, Quaternion::Identity()},
                      .X_BJ = {{-0.75 * kEdge, 0, 0}, Quaternion::Identity()},
                      .axis = {0, 0, 1}});
  }
  Hand hand(inertias, joints, poses, {0, 0, kEdge});
  hand.push({0, 0, -1}, 10);
  REQUIRE(hand.model().bodies().size() == 3);
  for (const HeldState& held : hand.model().held()) CHECK(held.number == 1);
  // Weightless: they move as one body of three masses, whose inner hinges stay closed.
  hand.push({0, 0, -1}, 200);
  const double apart = (hand.body(3).X_WB.p - hand.body(1).X_WB.p).norm();
  CHECK(apart == Approx(3 * kEdge).epsilon(1e-6));
  hand.push({0, 0, 3}, 400);
  for (const HeldState& held : hand.model().held()) CHECK(held.number == 2);
}

/// Two bars of 0.2 m that hang on each other.
std::vector<Mechanism::Member> pendulum() {
  std::vector<Mechanism::Member> members;
  for (std::uint32_t i = 0; i < 2; ++i) {
    const double moment = kMass * 0.2 * 0.2 / 12;
    members.push_back({{.body = i,
                        .mass = kMass,
                        .I_BCom = Vector3(moment, moment, 1e-5).asDiagonal(),
                        .gravity_W = {0, 0, -kGravity}},
                       {.body = i,
                        .parent = i == 0 ? kNoBody : 0,
                        .X_PJ = {{0, 0, i == 0 ? 0 : -0.1}, Quaternion::Identity()},
                        .X_BJ = {{0, 0, 0.1}, Quaternion::Identity()},
                        .axis = {0, 1, 0}}});
  }
  return members;
}

TEST_CASE("A double pendulum swings on with its energy, within 2 % for 2 s") {
  const auto members = pendulum();
  Mechanism bars(members);
  const Quaternion turn(Eigen::AngleAxisd(1.2, Vector3::UnitY()));
  const Vector3 half = turn * Vector3(0, 0, -0.1);
  const std::vector<BodyPose> poses{{.body = 0, .X_WB = {half, turn}},
                                    {.body = 1, .X_WB = {3 * half, turn}}};
  bars.set_state(poses, 1);
  const auto energy = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < 2; ++i) {
      const Pose X_WB = bars.X_WB(i);
      const Twist V = bars.velocity(i, X_WB.p);
      const Vector3 spin_B = X_WB.R.conjugate() * Vector3(V.tail<3>());
      sum += kMass * kGravity * X_WB.p.z() + kMass * V.head<3>().squaredNorm() / 2 +
             spin_B.dot(members[i].inertia.I_BCom * spin_B) / 2;
    }
    return sum;
  };
  const double begun = energy();
  CHECK(bars.X_WB(1).p.isApprox(3 * half, 1e-9));
  test::NoMalloc guard;
  for (int i = 0; i < 2000; ++i) {
    bars.begin_step(1e-3, 1);
    bars.advance(Velocity::Zero(2));
  }
  CHECK(energy() == Approx(begun).margin(0.02 * kMass * kGravity * 0.4));  // J, of what swings
}

// Ticks in which something moved, of scenes that the seeds 1 to count make.
int moved_in_scenes(std::uint64_t count) {
  int moved = 0;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    test::Random random(seed);
    const auto magnitude = [&](double least, double most) {
      return random.integer(0, 3) == 0 ? 0 : std::pow(10, random.uniform(least, most));
    };
    std::vector<BodyInertia> inertias;
    std::vector<BodyJoint> joints;
    std::vector<BodyPose> poses;
    for (std::uint32_t i = 1; i <= 3; ++i) {
      BodyInertia inertia = cube(i, magnitude(-3, 3));
      inertia.mass = std::pow(10, random.uniform(-6, 6));
      inertia.I_BCom *= std::pow(10, random.uniform(-10, 10));
      inertias.push_back(inertia);
      poses.push_back(at(i, {0, 0, -1.5 * kEdge * (i - 1)}));
      poses.back().V_W.setConstant(magnitude(-3, 1));
      if (random.integer(0, 2) == 0) continue;
      const double lower = -magnitude(-6, 9);
      joints.push_back(
          {.body = i,
           .parent = i == 1 ? kNoBody : i - 1,
           .type = random.integer(0, 1) == 0 ? JointType::kRevolute : JointType::kPrismatic,
           .X_PJ = {{0, 0, i == 1 ? 0 : -1.5 * kEdge}, Quaternion::Identity()},
           .axis = random.direction(),
           .lower = lower,
           .upper = lower + magnitude(-6, 9),
           .stiffness = magnitude(-9, 9),
           .reference = magnitude(-9, 9),
           .damping = magnitude(-9, 9),
           .friction = magnitude(-9, 9),
           .armature = magnitude(-9, 9)});
    }
    CAPTURE(seed);
    try {
      Hand hand(inertias, joints, poses, {0, 0, kEdge});
      for (int i = 0; i < 100; ++i) {
        const Vector3 felt = hand.push({0, 0, i < 50 ? -3.0 : 5.0}, 1);
        REQUIRE(felt.allFinite());
        REQUIRE(hand.model().velocity().allFinite());
        for (const HeldState& held : hand.model().held()) REQUIRE(held.pose.V_W.allFinite());
        moved += hand.model().bodies().empty() ? 0 : 1;
      }
    } catch (const std::invalid_argument&) {  // Its joints have no inertia of their own.
    }
  }
  return moved;
}

TEST_CASE("Whatever a scene may say of bodies and joints, what moves stays a number") {
  CHECK(moved_in_scenes(40) > 600);
}

TEST_CASE("Whatever three hundred scenes may say, what moves stays a number", "[optimised]") {
  CHECK(moved_in_scenes(300) > 5000);
}

TEST_CASE("A mechanism that cannot be is named") {
  const auto made = [](const std::vector<BodyInertia>& inertias,
                       const std::vector<BodyJoint>& joints) {
    std::vector<BodyInertia> known = inertias;
    mechanisms_of(known, joints);
  };
  CHECK_THROWS_WITH(made({cube(1)}, {{.body = 2}}), "joint of body 2: body 2 must have an inertia");
  CHECK_THROWS_WITH(made({cube(1)}, {{.body = 1, .parent = 7}}),
                    "joint of body 1: body 7 must have an inertia");
  CHECK_THROWS_WITH(made({cube(1), cube(2)}, {{.body = 1, .parent = 2}, {.body = 2, .parent = 1}}),
                    "joints of bodies must not make a loop");
  std::vector<BodyInertia> many;
  std::vector<BodyJoint> chain;
  for (std::uint32_t i = 0; i < 17; ++i) {
    many.push_back(cube(i));
    chain.push_back({.body = i, .parent = i == 0 ? kNoBody : i - 1});
  }
  // What is too large is a wall.
  many.push_back(cube(20));
  CHECK(mechanisms_of(many, chain).empty());
  REQUIRE(many.size() == 1);
  CHECK(many.front().body == 20);
}

}  // namespace
}  // namespace hlm::server
