// What the hand holds belongs to the server until it is let go (docs/method.md 21).
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/placed_shape.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;     // s
constexpr double kGravity = 9.81;  // m/s²
constexpr double kMass = 0.3;      // kg, of each cube
constexpr double kEdge = 0.04;     // m
constexpr double kTray = 0.01;     // m, height of the tray

BodyInertia inertia_of(std::uint32_t body) {
  const double moment = kMass * kEdge * kEdge / 6;
  return {.body = body,
          .mass = kMass,
          .I_BCom = moment * Matrix3::Identity(),
          .gravity_W = {0, 0, -kGravity}};
}

/// A tray of 0.5 kg without weight, held up at z = 0 by a spring, and cubes on it, one on the
/// other.
class Tray {
 public:
  explicit Tray(std::uint32_t cubes, bool known = true)
      : tool_(test::rigid_tool(0.5, Matrix3::Identity() * 1e-3)) {
    std::vector<PlacedShape> shapes{test::rough_box({0.1, 0.1, kTray}, {SideKind::kToolLink, 0})};
    std::vector<BodyInertia> inertias;
    for (std::uint32_t i = 0; i < cubes; ++i) {
      shapes.push_back(test::rough_box(Vector3::Constant(kEdge), {SideKind::kMovableBody, i}));
      inertias.push_back(inertia_of(i));
      const Vector3 p(0, 0, kTray / 2 + kEdge / 2 + i * kEdge);
      poses_.push_back({.body = i, .X_WB = {p, Quaternion::Identity()}});
    }
    if (!known) inertias.erase(inertias.begin());
    scene_ = std::make_unique<Scene>(std::move(shapes),
                                     std::span<const std::pair<std::uint32_t, std::uint32_t>>(),
                                     tool_, inertias);
    model_ = std::make_unique<LocalModel>(tool_, ToolModel(tool_).neutral(), LocalModelParameters(),
                                          kStep);
    model_->set_scene(scene_.get());
  }

  /// The environment says where it has the bodies, and who it thinks moves them.
  void adopt(bool holds = true) {
    model_->adopt({.contacts = ReportedContacts(),
                   .q_VE = model_->proxy().configuration(),
                   .poses = poses_,
                   .owners = owners_,
                   .holds = holds});
  }
  /// Steps under the spring, which pulls the tray to a height. Returns the latest force on it, N.
  double step(int count, double height = 0) {
    double force = 0;
    for (int i = 0; i < count; ++i) {
      HandInput hand;
      const Vector3 away = Vector3(0, 0, height) - model_->proxy().X_WH().p;
      hand.stiffness << Vector3::Constant(500), Vector3::Constant(5);
      hand.damping << Vector3::Constant(30), Vector3::Constant(0.1);
      hand.F = -hand.damping.cwiseProduct(model_->hand_twist());
      hand.F.head<3>() += 500 * away;
      force = model_->step(hand).F[2];
    }
    return force;
  }
  std::uint32_t number(std::uint32_t body) const {
    for (const HeldState& held : model_->held()) {
      if (held.pose.body == body) return held.number;
    }
    return 0;
  }
  std::size_t held() const {
    const auto held = model_->held();
    return static_cast<std::size_t>(
        std::ranges::count_if(held, [](const HeldState& state) { return is_held(state.number); }));
  }
  BodyPose& pose(std::uint32_t body) { return poses_[body]; }
  Ownership& owner(std::uint32_t body) {
    const auto found = std::ranges::find(owners_, body, &Ownership::body);
    return found != owners_.end() ? *found : owners_.emplace_back(Ownership{.body = body});
  }
  LocalModel& model() { return *model_; }

 private:
  ToolDescription tool_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<LocalModel> model_;
  BodyPoses poses_;
  Ownerships owners_;
};

TEST_CASE("A cube on the tray weighs what it weighs, whatever is reported of it since") {
  Tray tray(1);
  tray.adopt();
  tray.step(1500);
  CHECK(tray.number(0) == 1);
  CHECK(tray.step(1) == Approx(-kMass * kGravity).epsilon(1e-4));
  // The environment stands still, then has it somewhere else, and knows of nothing.
  for (const double z : {0.02, 0.5, -3.0}) {
    tray.pose(0).X_WB.p.z() = z;
    tray.adopt();
    CHECK(tray.step(1) == Approx(-kMass * kGravity).epsilon(1e-4));
  }
  CHECK(tray.number(0) == 1);
}

TEST_CASE("All cubes of a tower are held at once, and weigh together what they weigh",
          "[optimised]") {
  for (const std::uint32_t count : {2u, 5u, 8u}) {
    Tray tray(count);
    tray.adopt();
    tray.step(3);
    CHECK(tray.held() == count);
    tray.step(3000);
    CHECK(tray.held() == count);
    CHECK(tray.step(1) == Approx(-kMass * kGravity * count).epsilon(1e-3));
  }
}

TEST_CASE("A body of which nothing is known is a wall, and so are those on it") {
  Tray tray(2, false);
  tray.adopt();
  tray.step(100);
  CHECK(tray.held() == 0);
}

TEST_CASE(
    "Where nothing bears upon the tool for 0.3 s it is given back, and goes on until it is had") {
  Tray tray(1);
  tray.adopt();
  tray.step(1000);
  REQUIRE(tray.number(0) == 1);
  HandInput away;  // The tray falls faster than the cube.
  away.F[2] = -20;
  for (int i = 0; i < 295; ++i) tray.model().step(away);
  CHECK(tray.number(0) == 1);
  for (int i = 0; i < 20; ++i) tray.model().step(away);
  REQUIRE(tray.number(0) == 2);
  const double height = tray.model().held()[0].pose.X_WB.p.z();
  for (int i = 0; i < 100; ++i) tray.model().step(away);
  const BodyPose falling = tray.model().held()[0].pose;
  CHECK(falling.X_WB.p.z() < height - 0.2);  // m
  // The environment has not heard of it: nothing changes. Then it has.
  tray.adopt();
  CHECK(tray.model().held()[0].pose.X_WB.p == falling.X_WB.p);
  tray.owner(0).number = 2;
  tray.pose(0) = falling;
  tray.adopt();
  CHECK(tray.model().held().empty());
  CHECK(tray.model().bodies().empty());
}

TEST_CASE("The environment takes a body back by a higher even number, or keeps it") {
  for (const bool keeps : {false, true}) {
    Tray tray(1);
    tray.adopt();
    tray.step(1000);
    REQUIRE(tray.number(0) == 1);
    tray.pose(0).X_WB.p = {1, 0, 0};
    tray.owner(0).number = keeps ? 0 : 2;
    tray.owner(0).kept = keeps;
    tray.adopt();
    CHECK(tray.held() == 0);
    CHECK(tray.model().bodies().empty());
    // It is not there any more; what it weighed fades, and no step is above 0.5 N.
    double before = -kMass * kGravity;
    for (int i = 0; i < 500; ++i) {
      const double force = tray.step(1);
      CHECK(std::abs(force - before) < 0.5 + 1e-9);
      before = force;
    }
    CHECK(std::abs(before) < 0.01);
  }
}

TEST_CASE(
    "A number of a body that nobody moves here is answered by the next, and it is given back") {
  Tray tray(1);
  tray.pose(0).X_WB.p.x() = 1;
  tray.owner(0).number = 5;
  tray.adopt();
  tray.step(1);
  CHECK(tray.number(0) == 6);
  tray.owner(0).number = 6;
  tray.adopt();
  CHECK(tray.model().held().empty());
}

TEST_CASE("A hand that has no force holds nothing, and what it held is given back") {
  Tray tray(1);
  tray.adopt();
  tray.step(1000);
  tray.owner(0).number = 1;
  tray.model().release_bodies();
  tray.adopt(false);
  tray.step(10);
  CHECK(tray.number(0) == 2);
  CHECK(tray.model().bodies().empty());
}

TEST_CASE("A body that spins freely keeps its energy and its angular momentum within 1 % for 2 s") {
  // In whatever order its moments are, and however its axes are turned.
  const Vector3 moments = GENERATE(Vector3(1e-4, 2e-4, 2.5e-4), Vector3(2.5e-4, 2e-4, 1e-4),
                                   Vector3(2e-4, 1e-4, 2.5e-4));
  const Quaternion turn(Eigen::AngleAxisd(GENERATE(0.0, 0.7), Vector3(1, 2, -1).normalized()));
  const Matrix3 axes = turn.toRotationMatrix();
  const Matrix3 I = axes * moments.asDiagonal() * axes.transpose();
  BodyInertia inertia = inertia_of(0);
  inertia.I_BCom = I;
  BodyPose pose;
  pose.V_W << 0, 0, 0, 3, 4, -2;
  LocalBody body(inertia, pose);
  const auto momentum = [&] {
    const Matrix3 R = body.X_WB.R.toRotationMatrix();
    return Vector3(R * I * R.transpose() * body.V_W.tail<3>());
  };
  const auto energy = [&] { return body.V_W.tail<3>().dot(momentum()) / 2; };
  const Vector3 L = momentum();
  const double E = energy();
  for (int i = 0; i < 2000; ++i) {
    body.begin_step(kStep);
    body.advance(body.free_twist(kStep), kStep);
  }
  CHECK((momentum() - L).norm() < 0.01 * L.norm());
  CHECK(energy() == Approx(E).epsilon(0.01));
}

TEST_CASE("Taking, holding and giving back allocate nothing") {
  Tray tray(8);
  const test::NoMalloc guard;
  tray.adopt();
  tray.step(50);
  tray.adopt();
  HandInput away;
  away.F[2] = -50;
  for (int i = 0; i < 400; ++i) tray.model().step(away);
  tray.adopt(false);
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace hlm::server
