// An external wrench follows the link's motion as its reports have shown that it depends on it.
#include "hlm/haptic_server/local_model/wrench_field.h"

#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Eigenvalues>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

constexpr double kLength = 0.04;  // m
constexpr double kStep = 1e-3;    // s
constexpr double kFrame = 1.0 / 60;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

struct Motion {
  Pose X_WL;
  Twist V_W = Twist::Zero();
  Vector6 A_W = Vector6::Zero();
};

/// To and fro along z, by 20 mm, and about x by 0.2 rad.
Motion swing(double t, double omega = 20) {
  Motion motion;
  motion.X_WL.p.z() = 0.02 * std::sin(omega * t);
  motion.V_W[2] = 0.02 * omega * std::cos(omega * t);
  motion.A_W[2] = -0.02 * omega * omega * std::sin(omega * t);
  const double angle = 0.2 * std::sin(omega * t);
  motion.X_WL.R = rotation_from_vector({angle, 0, 0});
  motion.V_W[3] = 10 * motion.V_W[2];
  motion.A_W[3] = 10 * motion.A_W[2];
  return motion;
}

/// The field after some seconds of reports of such a wrench from a swinging link.
WrenchField learned(const std::function<Wrench(const Motion&)>& wrench, double time = 3) {
  WrenchField field(kLength);
  for (int i = 0; i * kFrame < time; ++i) {
    const Motion motion = swing(i * kFrame);
    field.report({i * kFrame, motion.X_WL, motion.V_W, wrench(motion)});
    for (int step = 0; step < 16; ++step) {
      field.begin_step(motion.X_WL, motion.V_W, kStep, kUnbounded);
      field.end_step(motion.V_W, kStep);
    }
  }
  return field;
}

Wrench along_z(double force) {
  Wrench F = Wrench::Zero();
  F[2] = force;
  return F;
}

/// What acts at rest at a pose, after `time` s of it.
Wrench at_rest(WrenchField& field, const Pose& X_WL, double time) {
  Wrench F = Wrench::Zero();
  for (double t = 0; t < time; t += kStep) {
    field.begin_step(X_WL, Twist::Zero(), kStep, kUnbounded);
    F = field.end_step(Twist::Zero(), kStep);
  }
  return F;
}

}  // namespace

TEST_CASE("A constant external wrench comes within tenths of a second, and stays what it is") {
  WrenchField field(kLength);
  CHECK_FALSE(field.acts());
  field.report({0, Pose{}, Twist::Zero(), along_z(-3)});
  REQUIRE(field.acts());
  CHECK_THAT(at_rest(field, Pose{}, 0.1)[2], WithinAbs(-3 * (1 - std::exp(-1)), 0.02));
  CHECK_THAT(at_rest(field, Pose{}, 1)[2], WithinAbs(-3, 1e-3));

  WrenchField moved = learned([](const Motion&) { return along_z(-3); });
  const auto step = moved.begin_step(Pose{{0, 0, 0.1}, {}}, along_z(0.5), kStep, kUnbounded);
  CHECK_THAT(step.F_W[2], WithinAbs(-3, 1e-6));
  CHECK(step.stiffness.isZero(1e-6));
  CHECK(step.damping.isZero(1e-6));
  CHECK(step.inertia.isZero(1e-6));
}

TEST_CASE("Drag and a payload's inertia are found from the reports, in translation and rotation") {
  const double damping = GENERATE(0.0, 20.0);     // N·s/m
  const double mass = GENERATE(0.0, 0.5);         // kg
  constexpr double kTurning = kLength * kLength;  // of a rotation, per length
  if (damping == 0 && mass == 0) return;
  WrenchField field = learned([&](const Motion& motion) {
    Wrench F = -damping * motion.V_W - mass * motion.A_W;
    F.tail<3>() *= kTurning;
    F[2] -= 9.81 * mass;
    return F;
  });
  const auto step = field.begin_step(Pose{}, Twist::Zero(), kStep, kUnbounded);
  for (const auto& [at, unit] : {std::pair(2, 1.0), std::pair(3, kTurning)}) {
    INFO("component " << at);
    CHECK_THAT(step.damping(at, at), WithinAbs(damping * unit, 2 * unit));
    CHECK_THAT(step.inertia(at, at), WithinAbs(mass * unit, 0.05 * unit));
  }
}

TEST_CASE("A wall is found from one report in it, and holds from there on") {
  constexpr double k = 2e4;  // N/m
  WrenchField field(kLength);
  const Twist down = along_z(-0.1);
  const auto report = [&](double time, double z) {
    const Pose X{{0, 0, z}, Quaternion::Identity()};
    field.report({time, X, down, along_z(k * std::max(0.0, -z))});
    field.begin_step(X, down, kStep, kUnbounded);
    field.end_step(down, kStep);
  };
  report(0, 3.4e-3);
  report(kFrame, 1.7e-3);
  report(2 * kFrame, 0);
  CHECK_FALSE(field.acts());
  report(3 * kFrame, -1.7e-3);
  const Pose pressed{{0, 0, -1e-4}, Quaternion::Identity()};
  CHECK_THAT(field.begin_step(pressed, down, kStep, kUnbounded).stiffness(2, 2),
             WithinRel(k, 1e-3));
  CHECK_THAT(at_rest(field, pressed, 1)[2], WithinAbs(k * 1e-4, 0.05));
}

TEST_CASE("A wrench that is not stated any more goes") {
  WrenchField field = learned([](const Motion&) { return along_z(-3); });
  CHECK_THAT(at_rest(field, Pose{}, 1)[2], WithinAbs(-3, 1e-3));
  field.report({3.5, Pose{}, Twist::Zero(), Wrench::Zero()});
  CHECK(at_rest(field, Pose{}, 0.01)[2] < -2.5);
  CHECK(std::abs(at_rest(field, Pose{}, 0.6)[2]) < 0.01);
  at_rest(field, Pose{}, 3);
  CHECK_FALSE(field.acts());
}

TEST_CASE("What has nothing to do with the link's motion is never much more than it was reported") {
  const bool dry = GENERATE(false, true);  // Friction that turns with the motion, or noise.
  test::Random random;
  WrenchField field(kLength);
  double most = 0;
  for (int i = 0; i < 1200; ++i) {
    const double time = i / 240.0;
    const Motion motion = swing(time);
    const double force = dry ? (motion.V_W[2] > 0 ? -2 : 2) : random.uniform(-0.5, 0.5);
    field.report({time, motion.X_WL, motion.V_W, along_z(force)});
    for (int step = 0; step < 4; ++step) {
      const Motion now = swing(time + 1e-3 * step);
      const auto begun = field.begin_step(now.X_WL, now.V_W, kStep, kUnbounded);
      most = std::max({most, std::abs(begun.F_W[2]), (begun.damping * now.V_W).norm()});
      field.end_step(now.V_W, kStep);
    }
  }
  CHECK(most < (dry ? 4.5 : 1.5));  // N
}

TEST_CASE("A wrench beyond the bound is constant, and no larger than that") {
  WrenchField field =
      learned([](const Motion& motion) { return along_z(-2e4 * motion.X_WL.p.z()); });
  const auto step =
      field.begin_step(Pose{{0, 0, 0.1}, Quaternion::Identity()}, Twist::Zero(), kStep, 24);
  CHECK_THAT(step.F_W[2], WithinAbs(-24, 1e-6));
  CHECK(step.stiffness.isZero());
}

TEST_CASE("Whatever is reported, what is found can only resist, and stays finite") {
  test::Random random;
  for (int run = 0; run < 50; ++run) {
    WrenchField field(kLength);
    const double size = std::pow(10, random.uniform(-6, 6));
    double time = 0;
    for (int i = 0; i < 200; ++i) {
      if (random.integer(0, 9) > 0) time += random.uniform(-0.005, 0.05);
      Twist V = Twist::Zero();
      V << random.vector(1), random.vector(10);
      Wrench F = Wrench::Zero();
      if (random.integer(0, 9) > 0) F << random.vector(size), random.vector(size);
      const Pose X = random.integer(0, 4) > 0 ? random.pose(0.1) : Pose{};
      field.report({time, X, V, F});
      const auto step = field.begin_step(X, V, kStep, kUnbounded);
      for (const Matrix6& part : {step.stiffness, step.damping, step.inertia}) {
        REQUIRE(part.allFinite());
        const double least = Eigen::SelfAdjointEigenSolver<Matrix6>(part).eigenvalues().minCoeff();
        REQUIRE(least >= -1e-6);  // N/m
      }
      V << random.vector(1), random.vector(10);
      REQUIRE(field.end_step(V, kStep).allFinite());
    }
  }
}

TEST_CASE("The local model carries an external wrench on any link of the tool") {
  test::Random random;
  const ToolDescription tool = test::random_tool(random, 3, JointType::kFree);
  const ToolModel at(tool);
  const Configuration q = test::random_configuration(random, at);
  LocalModel model(tool, q, {}, kStep);
  const Velocity rest = Velocity::Zero(at.dof());
  const auto link = static_cast<std::uint8_t>(tool.links.size() - 1);
  Wrench F = Wrench::Zero();
  F << random.vector(1), random.vector(0.01);
  ExternalWrenches external;
  external.push_back({link, 0.25 * F});
  external.push_back({link, 0.75 * F});
  const ReportedContacts none;
  model.adopt({.contacts = none, .q_VE = q, .v_VE = &rest, .external = external});
  // Held where it is, so that the wrench comes in at that pose.
  for (int i = 0; i < 1000; ++i) model.follow(q, rest);
  ToolModel held(tool);
  held.set_configuration(q);
  const GeneralisedForce due =
      held.jacobian(link, held.X_WL(link).p).transpose() * F - held.gravity();
  CHECK((model.load() - due).norm() <= 1e-3 * due.norm());
}

}  // namespace hlm::server
