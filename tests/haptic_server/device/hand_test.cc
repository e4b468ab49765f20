#include "hlm/haptic_server/device/hand.h"

#include <cmath>
#include <numbers>

#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

Wrench force(double x, double y, double z) {
  Wrench F = Wrench::Zero();
  F.head<3>() << x, y, z;
  return F;
}

Reach reach_to(const Vector3& position, const Vector3& rotation = Vector3::Zero()) {
  Reach reach;
  reach.position = position;
  reach.rotation = rotation;
  return reach;
}

/// Where the hand's target is: a hand without damping or force limit, on a handle at the origin.
Vector6 target(const Hand& hand, double t) {
  Vector6 e = hand.wrench(t, Pose{}, Twist::Zero());
  return e;
}

/// With unit stiffness the wrench on a handle at the origin is the target itself.
Reach unit_reach(const Vector3& position, const Vector3& rotation = Vector3::Zero()) {
  Reach reach = reach_to(position, rotation);
  reach.grip = {1, 0, 1, 0, 1e6, 1e6};
  return reach;
}

TEST_CASE("No script is no wrench") {
  Hand hand({});
  hand.start(Pose{});
  hand.advance(1, Pose{});
  CHECK(hand.wrench(1, Pose{}, Twist::Ones()) == Wrench::Zero());
}

TEST_CASE("A sinusoid matches its closed form, time counted from the segment's start") {
  const Push push{force(0, 0.5, 0), force(1, 0, 0), 2.5, 0.2};
  Hand hand({{{2.1, Push{}}, {8.0, push}}, AfterLastSegment::kRelease});
  hand.start(Pose{});
  for (double t = 2.1; t < 10; t += 0.01) {
    hand.advance(t, Pose{});
    const double sine = std::sin(5 * std::numbers::pi * (t - 2.1) + 0.2);
    REQUIRE((hand.wrench(t, Pose{}, Twist::Zero()) - force(sine, 0.5, 0)).norm() < 1e-12);
  }
}

TEST_CASE("A gripper opens and closes with minimum jerk, and stays where a segment says nothing") {
  CHECK_FALSE(Hand({}).opening(0));
  Hand hand({{{1.0, Push{}}, {2.0, Push{}, 0.2}, {1.0, Push{}}, {1.0, Push{}, 0.8}},
             AfterLastSegment::kHold});
  hand.start(Pose{});
  const auto at = [&](double t) {
    hand.advance(t, Pose{});
    return hand.opening(t).value();
  };
  CHECK(at(0) == 0.2);  // As the first segment that says something.
  CHECK(at(2.9) == 0.2);
  CHECK(at(3.5) == 0.2);
  CHECK(std::abs(at(4.5) - 0.5) < 1e-12);
  CHECK(at(9) == 0.8);
  hand.start(Pose{});
  CHECK(at(0) == 0.2);
}

TEST_CASE("After the last segment the hand releases, holds or repeats, as asked") {
  const std::vector<HandSegment> segments{{1.0, Push{.constant = force(1, 0, 0)}},
                                          {1.0, Push{.constant = force(2, 0, 0)}}};
  const auto at = [&](AfterLastSegment after, double t) {
    Hand hand({segments, after});
    hand.start(Pose{});
    for (double step = 0; step <= t; step += 0.125) hand.advance(step, Pose{});
    return hand.wrench(t, Pose{}, Twist::Zero())[0];
  };
  for (const auto after :
       {AfterLastSegment::kRelease, AfterLastSegment::kHold, AfterLastSegment::kRepeat}) {
    CHECK(at(after, 0.5) == 1);
    CHECK(at(after, 1.5) == 2);
  }
  CHECK(at(AfterLastSegment::kRelease, 2.5) == 0);
  CHECK(at(AfterLastSegment::kHold, 2.5) == 2);
  CHECK(at(AfterLastSegment::kRepeat, 2.5) == 1);
  CHECK(at(AfterLastSegment::kRepeat, 3.5) == 2);
}

TEST_CASE("The target of a reach moves with minimum jerk and stays at its end") {
  Hand hand({{{2.0, unit_reach({0.1, 0, 0}, {0, 0, 1})}}, AfterLastSegment::kHold});
  hand.start(Pose{});
  for (double t = 0; t <= 2; t += 0.01) {
    const double u = t / 2;
    const double way = 10 * std::pow(u, 3) - 15 * std::pow(u, 4) + 6 * std::pow(u, 5);
    REQUIRE(std::abs(target(hand, t)[0] - 0.1 * way) < 1e-12);
    REQUIRE(std::abs(target(hand, t)[5] - way) < 1e-9);
  }
  hand.advance(5, Pose{});
  CHECK(std::abs(target(hand, 5)[0] - 0.1) < 1e-12);
}

TEST_CASE("The hand's damper acts against the target's velocity, not against the motion") {
  Reach reach = reach_to({0.1, 0, 0});
  reach.grip = {0, 10, 0, 0, 1e6, 1e6};
  Hand hand({{{2.0, reach}}, AfterLastSegment::kHold});
  hand.start(Pose{});
  // Minimum jerk is fastest half way: 15/8 of the mean speed.
  CHECK(std::abs(hand.wrench(1, Pose{}, Twist::Zero())[0] - 10 * 15.0 / 8 * 0.05) < 1e-12);
  Twist V_WD = Twist::Zero();
  V_WD[0] = 15.0 / 8 * 0.05;
  CHECK(hand.wrench(1, Pose{}, V_WD).norm() < 1e-12);
}

TEST_CASE("A reach goes on from the target before, after a push from the handle") {
  const Pose X_WD{Vector3(0.05, 0, 0), Quaternion::Identity()};
  Hand hand({{{1.0, unit_reach({0.2, 0, 0})},
              {1.0, unit_reach({0.3, 0, 0})},
              {1.0, Push{}},
              {1.0, unit_reach({0.3, 0, 0})}},
             AfterLastSegment::kHold});
  hand.start(X_WD);
  const auto target_x = [&](double t) { return hand.wrench(t, X_WD, Twist::Zero())[0] + 0.05; };
  CHECK(std::abs(target_x(0) - 0.05) < 1e-12);
  hand.advance(1, X_WD);
  CHECK(std::abs(target_x(1) - 0.2) < 1e-12);
  hand.advance(2, X_WD);
  hand.advance(3, X_WD);
  CHECK(std::abs(target_x(3) - 0.05) < 1e-12);
}

TEST_CASE(
    "A relative target counts from the start of the session, an absolute one from the world") {
  test::Random random;
  const Pose X_WH = random.pose(0.2);
  const Vector3 position = random.vector(0.1);
  const Vector3 rotation = random.vector(0.5);
  Reach reach = unit_reach(position, rotation);
  reach.relative = GENERATE(false, true);
  Hand hand({{{1.0, reach}}, AfterLastSegment::kHold});
  hand.start(X_WH);
  const Pose X_WTarget = reach.relative
                             ? Pose{X_WH.p + position, rotation_from_vector(rotation) * X_WH.R}
                             : Pose{position, rotation_from_vector(rotation)};
  CHECK(hand.wrench(1, X_WTarget, Twist::Zero()).norm() < 1e-9);
}

TEST_CASE("What a reach leaves out stays as it was") {
  Reach turn;
  turn.rotation = Vector3(0, 0, 0.5);
  turn.grip = {1, 0, 1, 0, 1e6, 1e6};
  Hand hand(
      {{{1.0, unit_reach({0.1, 0.2, 0}, {0, 0, 0.1})}, {1.0, turn}}, AfterLastSegment::kHold});
  hand.start(Pose{});
  hand.advance(1, Pose{});
  CHECK((target(hand, 2).head<3>() - Vector3(0.1, 0.2, 0)).norm() < 1e-12);
  CHECK(std::abs(target(hand, 2)[5] - 0.5) < 1e-9);
}

TEST_CASE("The hand does not pull harder than its limits") {
  Reach reach = reach_to({1, 1, 0}, {0, 0, 3});
  reach.grip.max_force = 2;
  reach.grip.max_torque = 0.1;
  Hand hand({{{1.0, reach}}, AfterLastSegment::kHold});
  hand.start(Pose{});
  const Wrench F = hand.wrench(1, Pose{}, Twist::Zero());
  CHECK((F.head<3>() - Vector3(std::sqrt(2), std::sqrt(2), 0)).norm() < 1e-12);
  CHECK(std::abs(F[5] - 0.1) < 1e-12);
}

TEST_CASE("A hand brings a device to its target within dry friction over stiffness") {
  SimulatedDeviceOptions options;
  Reach reach = reach_to({0.05, -0.03, 0}, {0, 0, std::numbers::pi / 2});
  SimulatedDevice device(options, {{{1.0, reach}}, AfterLastSegment::kHold}, 1e-3);
  device.align(Pose{});
  for (int i = 0; i < 3000; ++i) device.write(Wrench::Zero());
  const DeviceState state = *device.read();
  CHECK((state.X_WD.p - *reach.position).norm() <= options.dry_friction / reach.grip.stiffness);
  CHECK(std::abs(rotation_vector(state.X_WD.R).z() - std::numbers::pi / 2) < 1e-3);
  CHECK(state.V_WD.norm() < 1e-3);
}

}  // namespace
}  // namespace hlm::server
