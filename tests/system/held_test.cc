// What the hand holds, with the whole loop through the network: server and client together, in
// virtual time (docs/method.md 21).
#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "hlm/protocol/codec.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

using server::TickRecord;

constexpr double kGravity = 9.81;  // m/s²
constexpr double kMass = 0.3;      // kg, of each cube
constexpr double kWait = 3;        // s, until the server has the shapes

std::string box(const std::string& name, const std::string& size, const std::string& pose) {
  return "<collision name='" + name + "'><pose>" + pose + "</pose><geometry><box><size>" + size +
         "</size></box></geometry></collision>";
}

std::string body(const std::string& name, double mass, const std::string& pose,
                 const std::string& elements, const std::string& joint = "") {
  return fmt::format(
      "<model name='{}'><pose>{}</pose><link "
      "name='body'><inertial><mass>{}</mass><inertia><ixx>1.25e-4"
      "</ixx><iyy>1.25e-4</iyy><izz>1.25e-4</izz></inertia></inertial>{}</link>{}</model>",
      name, pose, mass, elements, joint);
}

/// Cubes of 50 mm on each other on two rails, and a tray without weight below them.
ve::WorldDescription tower(int cubes, const std::string& others = "") {
  std::string models =
      others + "<model name='rails'><static>true</static><link name='body'>" +
      box("left", "0.01 0.1 0.02", "-0.02 0 -0.01 0 0 0") +
      box("right", "0.01 0.1 0.02", "0.02 0 -0.01 0 0 0") + "</link></model>" +
      body("tray", 0.4, "0 0 -0.01 0 0 0",
           "<gravity>false</gravity>" + box("box", "0.026 0.06 0.01", "0 0 0 0 0 0"));
  for (int i = 0; i < cubes; ++i) {
    models += body(fmt::format("cube{}", i), kMass, fmt::format("0 0 {} 0 0 0", 0.025 + 0.05 * i),
                   box("box", "0.05 0.05 0.05", "0 0 0 0 0 0"));
  }
  return world_of(models, "0 0 -9.81");
}

server::HandSegment reach(const Vector3& way, double duration) {
  server::Reach reach;
  reach.position = way;
  reach.relative = true;
  reach.grip = {.stiffness = 1000,
                .damping = 40,
                .angular_stiffness = 20,
                .angular_damping = 0.5,
                .max_force = 100,
                .max_torque = 5};
  return {duration, reach};
}

/// Lifted by 80 mm, carried to the side, and put down on the rails.
VirtualSessionOptions carry(int cubes, double rate, const LinkConditions& link) {
  VirtualSessionOptions options;
  options.world = tower(cubes);
  options.tool = "tray";
  options.hand = {{reach({0, 0, 0}, kWait), reach({0, 0, 0.08}, 1), reach({0, 0.03, 0.08}, 1),
                   reach({0, 0.03, 0.08}, 2), reach({0, 0, 0.08}, 1), reach({0, 0, -0.01}, 1.5)},
                  server::AfterLastSegment::kHold};
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.dry_friction = 0;
  options.device.max_force = 50;
  options.link = link;
  options.rate_low = options.rate_high = rate;
  options.frame.shapes = true;
  return options;
}

int body_named(const ve::World& world, const std::string& name) {
  const auto& bodies = world.description().bodies;
  const auto found = std::ranges::find(bodies, name + "::body", &ve::BodyDescription::name);
  REQUIRE(found != bodies.end());
  return static_cast<int>(found - bodies.begin());
}

TEST_CASE("A carried tower weighs what it weighs within 0.1 %, at any rate, delay and loss") {
  struct Condition {
    int cubes;
    double rate;  // Hz
    LinkConditions link;
  };
  const std::vector<Condition> conditions{{1, 60, {.delay = 0}},
                                          {1, 15, {.delay = 0.5}},
                                          {2, 30, {.delay = 0.02, .loss = 0.2}},
                                          {5, 60, {.delay = 0.1}}};
  for (const auto& [cubes, rate, link] : conditions) {
    std::vector<double> weights;
    double highest = 0;  // m
    VirtualSession* running = nullptr;
    VirtualSession session(carry(cubes, rate, link), [&](const TickRecord& tick) {
      const double time = static_cast<double>(tick.step) * 1e-3;
      if (time > kWait + 3 && time < kWait + 4) weights.push_back(-tick.F_env[2]);
      const ve::World& world = running->environment().world;
      highest = std::max(highest, world.X_WB(body_named(world, "cube0")).p.z());
    });
    running = &session;
    session.run(kWait + 9 + 4 * link.delay);
    REQUIRE(weights.size() > 900);
    const auto [least, most] = std::ranges::minmax(weights);
    const double due = cubes * kMass * kGravity;
    INFO(cubes << " cubes, " << rate << " Hz, " << link.delay << " s each way, loss " << link.loss);
    CHECK(least == Approx(due).epsilon(1e-3));
    CHECK(most == Approx(due).epsilon(1e-3));
    CHECK(highest > 0.08);  // m: less what the load draws the hand down
    // They stand on the rails again, and are the environment's.
    const ve::World& world = session.environment().world;
    for (int i = 0; i < cubes; ++i) {
      const Pose X = world.X_WB(body_named(world, fmt::format("cube{}", i)));
      CHECK(X.p.z() == Approx(0.025 + 0.05 * i).margin(1e-3));
      CHECK(X.p.head<2>().norm() < 1e-3);
    }
    CHECK(session.servo().local_model()->held().empty());
  }
}

TEST_CASE(
    "Whatever a client says of who moves its bodies and where they are, force stays within its "
    "limit") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    CAPTURE(seed);
    VirtualSessionOptions options = carry(3, 60, {.delay = 0.02});
    double most = 0;  // N
    bool finite = true;
    VirtualSession session(options, [&](const TickRecord& tick) {
      most = std::max(most, tick.F_command.head<3>().norm());
      finite = finite && tick.F_command.allFinite() && tick.F_env.allFinite();
    });
    Random random(seed);
    session.network().set_alteration([&](std::span<std::byte> bytes) {
      protocol::Header header;
      protocol::ContactUpdate update;
      if (protocol::decode_header(bytes, header) ||
          header.type != protocol::MessageType::kContactUpdate || header.parts != 1 ||
          protocol::decode_part(bytes, update) || random.integer(0, 4) != 0) {
        return;
      }
      for (Ownership& owner : update.owners) {
        owner.number = random.integer(0, 1) == 0 ? static_cast<std::uint32_t>(random.engine()())
                                                 : owner.number + 1;
        owner.kept = random.integer(0, 3) == 0;
        owner.slowed = static_cast<std::uint8_t>(random.integer(0, 255));
      }
      for (BodyPose& pose : update.poses) {
        pose.X_WB.p += random.vector(0.05);
        pose.V_W.head<3>() += random.vector(10);
      }
      const auto altered = protocol::encode(header.envelope, update, header.part);
      std::copy(altered.begin(), altered.end(), bytes.begin());
    });
    session.run(kWait + 4);
    CHECK(finite);
    CHECK(most <= options.servo.limits.max_force + 1e-9);
    CHECK(session.last().fault == Fault::kNone);
  }
}

/// A cube on a tray is lifted, while a rod on a ball joint, of which the server cannot be told,
/// hangs within the tool's reach.
TEST_CASE("A cube is held while the environment moves something else nearby") {
  VirtualSessionOptions options = carry(1, 60, {.delay = 0.05});
  options.world =
      tower(1, body("rod", 0.5, "0.06 0 0.1 0 0 0", box("box", "0.02 0.02 0.2", "0 0 0 0 0 0"),
                    "<joint name='ball' type='ball'><pose>0 0 0.1 0 0 0</pose><parent>"
                    "world</parent><child>body</child></joint>"));
  std::vector<double> weights;
  VirtualSession* running = nullptr;
  VirtualSession session(options, [&](const TickRecord& tick) {
    const double time = static_cast<double>(tick.step) * 1e-3;
    if (time < kWait + 3 || time > kWait + 4) return;
    weights.push_back(-tick.F_env[2]);
    CHECK(running->servo().local_model()->moves_ahead());
  });
  running = &session;
  session.run(kWait + 4);
  REQUIRE(weights.size() > 900);
  const auto [least, most] = std::ranges::minmax(weights);
  CHECK(least == Approx(kMass * kGravity).epsilon(1e-3));
  CHECK(most == Approx(kMass * kGravity).epsilon(1e-3));
  // While nobody hears of it the rod is let go of, and the cube is not.
  session.run_server_alone(1);
  CHECK(session.servo().local_model()->held().size() == 1);
  CHECK_FALSE(session.servo().local_model()->moves_ahead());
}

/// The tool pushes a brick, which is held, against a pendulum on a ball joint, which is not: 0.5 kg
/// with its centre 0.1 m below the joint. Friction of the brick is 2.94 N.
TEST_CASE("What is held pushes what the environment moves, and the hand feels both") {
  for (const double delay : {0.0, 0.02, 0.1}) {
    VirtualSessionOptions options = carry(0, 60, {.delay = delay});
    options.world = world_of(
        "<model name='table'><static>true</static><link name='body'>" +
            box("top", "1 1 0.02", "0 0 -0.01 0 0 0") + "</link></model>" +
            body("tray", 0.4, "0 0 0.025 0 0 0",
                 "<gravity>false</gravity>" + box("box", "0.02 0.04 0.04", "0 0 0 0 0 0")) +
            body("brick", kMass, "0.045 0 0.025 0 0 0",
                 box("box", "0.05 0.05 0.05", "0 0 0 0 0 0")) +
            body("rod", 0.5, "0.1 0 0.075 0 0 0", box("box", "0.02 0.04 0.12", "0 0 0 0 0 0"),
                 "<joint name='ball' type='ball'><pose>0 0 0.1 0 0 0</pose><parent>world</parent>"
                 "<child>body</child></joint>"),
        "0 0 -9.81");
    options.hand = {{reach({0, 0, 0}, kWait), reach({0.06, 0, 0}, 2), reach({0.06, 0, 0}, 2)},
                    server::AfterLastSegment::kHold};
    std::vector<double> steady;  // N
    double most = 0;             // N, as the pendulum swings against the brick
    VirtualSession session(options, [&](const TickRecord& tick) {
      most = std::max(most, -tick.F_env[0]);
      if (static_cast<double>(tick.step) * 1e-3 > kWait + 3) steady.push_back(-tick.F_env[0]);
    });
    session.run(kWait + 4);
    INFO(delay << " s each way");
    const auto& model = session.servo().local_model();
    CHECK(model->held().size() == 1);
    CHECK(model->moves_ahead());
    CHECK(most < 8);
    REQUIRE(steady.size() > 900);
    const auto [least, largest] = std::ranges::minmax(steady);
    CHECK(least == Approx(3.3).epsilon(0.015));
    CHECK(largest == Approx(3.3).epsilon(0.015));
  }
}

TEST_CASE("What the hand carries and puts down while nobody hears of it lies where it was put") {
  VirtualSession session(carry(1, 60, {.delay = 0.02}));
  session.run(kWait + 3.5);
  session.run_server_alone(4);  // Beyond the silence: without force, but held.
  session.run(3);
  const ve::World& world = session.environment().world;
  const Pose X = world.X_WB(body_named(world, "cube0"));
  CHECK(X.p.z() == Approx(0.025).margin(1e-3));
  CHECK(X.p.head<2>().norm() < 2e-3);
  CHECK(session.servo().local_model()->held().empty());
}

TEST_CASE("Force is gone 2.1 s after the last word of a client whose server holds") {
  VirtualSession session(carry(1, 60, {.delay = 0.02}));
  session.run(kWait + 3);
  session.run_server_alone(1.9);
  CHECK(session.last().F_command.norm() > 1);  // N
  session.run_server_alone(0.25);
  CHECK(session.last().F_command.isZero(0));
}

TEST_CASE("Where the server dies, or its client does, what was held is the environment's again") {
  VirtualSession session(carry(1, 60, {.delay = 0.02}));
  session.run(kWait + 3);
  const ve::World& world = session.environment().world;
  const int cube = body_named(world, "cube0");
  REQUIRE(world.X_WB(cube).p.z() > 0.09);
  session.server(0).stop();
  session.run(4);
  CHECK_FALSE(session.client().connected());
  // Nobody carries it: it lies on the tray, which stands still, or has fallen off it.
  CHECK(world.V_WB(cube).norm() < 0.01);
  CHECK(world.X_WB(cube).p.z() < 0.12);
}

}  // namespace
}  // namespace hlm::test
