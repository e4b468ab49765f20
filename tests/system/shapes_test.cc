// The geometry near the hand in the server: sessions in virtual time (docs/method.md 18).
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

using server::TickRecord;

constexpr double kStiffness = 4000;  // N/m, of a contact

/// A peg of 20 mm at the origin before a wall, which a hand leads. face: of the wall, at x, m.
VirtualSessionOptions before_wall(double delay, double face = 0.05) {
  VirtualSessionOptions options;
  options.world =
      world_of(fixed_model("wall", std::to_string(face + 0.05) + " 0 0 0 0 0", box("0.1 0.2 0.2")) +
               model("peg", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                     "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.device.dry_friction = 0;
  options.servo.silence_time = 2;
  options.link = {.delay = delay};
  options.frame.shapes = true;
  return options;
}

TEST_CASE("With shapes the server finds the contacts, and updates bring none") {
  VirtualSessionOptions options = before_wall(0.02);
  options.hand = constant_push(force(2, 0));
  VirtualSession session(options);
  session.run(1.5);
  REQUIRE(session.client().has_scene());
  CHECK(session.client().scene_state().placements == 2);
  const server::LocalContacts& contacts = session.servo().local_model()->contacts();
  REQUIRE(contacts.size() == 2);  // Of a planar tool one at each corner.
  for (const server::LocalContact& contact : contacts) {
    CHECK(contact.of_scene);
    CHECK(contact.now.s == Approx(-2.0 / 2 / kStiffness).epsilon(0.02));
  }
  CHECK(session.last().F_env[0] == Approx(-2).epsilon(0.01));
}

TEST_CASE("More than half a second each way a wall is felt where it is, and force lasts") {
  VirtualSessionOptions options = before_wall(0.6);
  // It waits until the scene is there.
  options.hand = {{{4.0, server::Push{}}, {6.0, server::Push{.constant = force(2, 0)}}},
                  server::AfterLastSegment::kHold};
  double met_at = 0;  // m
  VirtualSession session(options, [&](const TickRecord& tick) {
    if (met_at == 0 && tick.F_env[0] < -0.1) met_at = tick.X_WP.p.x() + 0.01;
  });
  session.run(9);
  CHECK(met_at == Approx(0.05).margin(5e-4));  // m: v·h
  CHECK(session.last().server == ServerState::kActive);
  CHECK(session.last().F_env[0] == Approx(-2).epsilon(0.01));
}

TEST_CASE("An external wrench that is older than contacts may be gives no force, shapes or not") {
  const VirtualSessionOptions options = before_wall(0.1);
  server::Reach reach;
  reach.position = Vector3::Zero();
  VirtualServer server(options, {{{1.0, reach}}, server::AfterLastSegment::kHold}, 1);
  const ve::VirtualEnvironment environment(options.world, {options.tool}, {});
  const ve::ToolAssembly& assembly = environment.tools[0].assembly;
  HapticClient client(server.network().client(), {.server = MemoryNetwork::kServer,
                                                  .tool = assembly.description,
                                                  .q = assembly.q,
                                                  .nonce = 1});
  client.offer_scene(ve::scene_of(environment.world, assembly, false));
  double felt = 0;  // N
  VirtualClock clock([&](double now) {
    if (const TickRecord* tick = server.tick(now)) felt = tick->F_env[0];
  });
  const auto run = [&](double duration) {
    for (const double end = clock.now() + duration; clock.now() < end;) {
      client.poll(clock.now());
      client.sample(clock.now(), assembly.q, Velocity::Zero(3), 1.0 / 60);
      client.add_external(0, force(-2, 0));
      client.send(clock.now(), {});
      clock.sleep_until(clock.now() + 1.0 / 60);
    }
  };
  run(3);
  REQUIRE(client.has_scene());
  CHECK(felt == Approx(-2).epsilon(0.01));
  server.network().set_conditions({.delay = 0.5});
  run(4);
  CHECK(server.last().server == ServerState::kActive);
  CHECK(std::abs(felt) < 0.01);
}

TEST_CASE("A scene that comes under load steps no force, and the wall stays where it is") {
  VirtualSessionOptions options = before_wall(0.01, 0.012);
  options.hand = constant_push(force(8, 0));
  std::vector<TickRecord> ticks;
  VirtualSession session(options, [&](const TickRecord& tick) { ticks.push_back(tick); });
  session.server(0).idle(1500);
  session.run(1.4);
  REQUIRE(session.servo().local_model()->scene() == nullptr);
  REQUIRE(session.last().F_env[0] == Approx(-8).epsilon(0.02));
  ticks.clear();
  session.run(1.5);
  REQUIRE(session.servo().local_model()->scene() != nullptr);
  double step = 0;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    step = std::max(step, (ticks[i].F_env - ticks[i - 1].F_env).head<3>().norm());
  }
  CHECK(step <= 0.6);  // N
  CHECK(session.last().F_env[0] == Approx(-8).epsilon(0.02));
  CHECK(session.last().X_WP.p.x() == Approx(0.002 + 8.0 / 2 / kStiffness).margin(1e-4));
}

TEST_CASE("A wall that comes at 0.2 m/s is felt where its shape is, and pushes the tool along") {
  const double delay = GENERATE(0.0, 0.02);  // s each way
  constexpr double kSpeed = 0.2;             // m/s
  constexpr int kWall = 1;
  VirtualSessionOptions options;
  options.world = world_of(model("tool", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>") +
                           model("wall", "0.15 0 0 0 0 0", box("0.02 0.1 0.1")));
  options.tool = "tool";
  options.link = {.delay = delay};
  options.rate_low = options.rate_high = 50;
  options.frame.shapes = options.frame.push_by_following = true;
  options.hand = constant_push(force(1, 0));
  VirtualSession* running = nullptr;
  double largest = 0;  // m
  bool watches = false;
  VirtualSession session(options, [&](const TickRecord& tick) {
    if (!watches) return;
    // Where the world has the wall after its latest step.
    const double wall = running->environment().world.X_WB(kWall).p.x() - 0.01;
    largest = std::max(largest, std::abs(tick.X_WP.p.x() + 0.01 - wall));
  });
  running = &session;
  ve::World& world = session.environment().world;
  world.make_kinematic(kWall);
  session.run(0.3);
  Twist V = Twist::Zero();
  V[0] = -kSpeed;
  world.set_velocity(kWall, V);
  session.run(1.2);  // The tool is knocked away first, and pushed back.
  watches = true;
  session.run(0.3);
  // The world is ahead or behind by up to a frame and what is under way.
  CHECK(largest < kSpeed * (1.5 * 0.02 + delay) + 5e-4);
  CHECK(session.last().F_env[0] < -0.5);
}

TEST_CASE(
    "A hand stronger than the device does not push the tool through a wall of several pieces") {
  VirtualSessionOptions options = before_wall(0.01);
  std::string wall;
  for (const char* y : {"-0.1", "0.1"}) {
    wall += fixed_model(std::string("wall") + y, "0.06 " + std::string(y) + " 0 0 0 0",
                        box("0.02 0.2 0.2"));
  }
  options.world = world_of(wall + model("peg", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                                        "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.hand = constant_push(force(20, 0));  // The device gives 12 N.
  options.hand.segments.insert(options.hand.segments.begin(),
                               {0.3, server::Push{}});  // Until the shapes are there.
  double farthest = 0;                                  // m
  VirtualSession session(
      options, [&](const TickRecord& tick) { farthest = std::max(farthest, tick.X_WP.p.x()); });
  session.run(0.9);
  REQUIRE(session.client().has_scene());
  CHECK(session.last().X_WD.p.x() > 0.1);  // It is past the wall.
  CHECK(farthest < 0.04 + 0.006);
  CHECK(session.last().F_env[0] < -10);
}

/// A peg of 40 mm is led at up to `speed` (m/s) into a hole that is wider by `clearance` on each
/// side (m), and touches nothing. Returns the largest force, N. `phase`: of the way within a tick,
/// s.
double enter_freely(double clearance, double speed, double phase) {
  constexpr double kLength = 0.12;  // m
  const auto block = [&](const std::string& name, double side) {
    const double x = side * (0.07 + clearance);
    return fixed_model(name, std::to_string(x) + " -0.07 0 0 0 0", box("0.1 0.14 0.04"));
  };
  VirtualSessionOptions options;
  options.world = world_of(block("left", -1) + block("right", 1) +
                           model("peg", "0 0.1 0 0 0 0", box("0.04 0.08 0.04"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.device.dry_friction = 0;
  options.device.max_force = 100;
  options.device.max_force_rate = 1e9;
  options.servo.limits.max_force = 100;
  options.servo.handle = {.max_speed = 1e9, .max_rate = 1e9, .workspace = 1e9};
  options.frame.shapes = true;
  server::Reach reach;
  reach.grip = {.stiffness = 2000, .damping = 80, .max_force = 100};
  reach.position = Vector3(0, 0.1, 0);
  options.hand.segments.push_back({0.3 + phase, reach});
  reach.position = Vector3(0, 0.1 - kLength, 0);
  const double duration = 1.875 * kLength / speed;  // Of a reach with minimum jerk.
  options.hand.segments.push_back({duration, reach});
  options.hand.after = server::AfterLastSegment::kHold;
  double most = 0;
  VirtualSession session(
      options, [&](const TickRecord& tick) { most = std::max(most, tick.F_env.head<3>().norm()); });
  session.run(0.5 + phase + duration);
  CHECK(session.client().has_scene());
  CHECK(session.last().X_WP.p.y() < -0.015);  // It is in.
  return most;
}

TEST_CASE("A peg that touches nothing on its way into a hole is not felt, however fast it is") {
  for (const auto& [clearance, speed] :
       {std::pair{1e-4, 0.3}, {3e-4, 1.0}, {5e-5, 0.1}, {2e-5, 0.5}}) {
    for (int i = 0; i < 7; ++i) {
      CAPTURE(clearance, speed, i);
      CHECK(enter_freely(clearance, speed, i * 1e-3 / 7) == 0);
    }
  }
}

TEST_CASE("A plate thinner than the way of a tick stops the tool on its side") {
  const double thickness = GENERATE(0.0002, 0.0005, 0.002);  // m
  VirtualSessionOptions options = before_wall(0.0);
  options.world = world_of(fixed_model("plate", std::to_string(0.06 + thickness / 2) + " 0 0 0 0 0",
                                       box(std::to_string(thickness) + " 0.2 0.2")) +
                           model("peg", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.hand = constant_push(force(15, 0));
  options.hand.segments.insert(options.hand.segments.begin(), {0.3, server::Push{}});
  double fastest = 0;   // m/s
  double farthest = 0;  // m
  VirtualSession session(options, [&](const TickRecord& tick) {
    fastest = std::max(fastest, tick.V_WP[0]);
    farthest = std::max(farthest, tick.X_WP.p.x());
  });
  session.run(0.6);
  CHECK(fastest > 0.5);
  CHECK(farthest < 0.05 + 0.01);
}

TEST_CASE("A client with shapes that falls silent takes the force with it, and may come back") {
  VirtualSessionOptions options = before_wall(0.005);
  options.servo.silence_time.reset();
  options.hand = constant_push(force(2, 0));
  VirtualSession session(options);
  session.run(1);
  REQUIRE(session.last().F_command[0] == Approx(-2).epsilon(0.02));
  session.run_server_alone(0.4);
  CHECK(session.last().F_command.norm() < 1e-9);
  session.run(1);
  CHECK(session.last().fault == Fault::kNone);
  CHECK(session.client().has_scene());
  CHECK(session.last().F_command[0] == Approx(-2).epsilon(0.02));
}

TEST_CASE("A server that takes no shapes gets contacts, and the client knows why") {
  VirtualSessionOptions options = before_wall(0.01);
  options.takes_scenes = false;
  options.hand = constant_push(force(2, 0));
  VirtualSession session(options);
  session.run(1);
  CHECK_FALSE(session.client().has_scene());
  CHECK(session.client().scene_problem() == "the server takes no scenes: it is older, or set so");
  CHECK(session.last().F_env[0] == Approx(-2).epsilon(0.02));
}

TEST_CASE(
    "A scene whose ticks take longer than their period goes, and contacts come in its place") {
  VirtualSessionOptions options = before_wall(0.01, 0.012);
  options.hand = constant_push(force(8, 0));
  std::vector<TickRecord> ticks;
  VirtualSession session(options, [&](const TickRecord& tick) { ticks.push_back(tick); });
  session.run(1.5);
  REQUIRE(session.client().has_scene());
  session.server(0).take(0.0009);
  session.run(1);
  CHECK(session.client().has_scene());
  session.server(0).take(0.004);  // In one frame: the machine stalls.
  session.run(0.001);
  session.server(0).take(0.0004);
  session.run(1);
  CHECK(session.client().has_scene());
  ticks.clear();
  session.server(0).take(0.0015);  // 0.2 s late after 400 ticks.
  session.run(0.3);
  CHECK(session.client().has_scene());
  session.run(1);
  CHECK_FALSE(session.client().has_scene());
  CHECK_THAT(session.client().scene_problem(),
             Catch::Matchers::ContainsSubstring("more time than a tick has"));
  CHECK(session.client().scene_state().error == protocol::SceneError::kSlow);
  const server::LocalContacts& contacts = session.servo().local_model()->contacts();
  REQUIRE_FALSE(contacts.empty());
  for (const server::LocalContact& contact : contacts) CHECK_FALSE(contact.of_scene);
  for (const TickRecord& tick : ticks) {
    CHECK(tick.server == ServerState::kActive);
    // The client's contacts are others: these begin as the scene's end.
    CHECK(tick.F_env[0] == Approx(-8).margin(3.5));  // N
    CHECK(tick.X_WP.p.x() < 0.0035 + 0.0015);        // m
  }
  CHECK(session.last().F_env[0] == Approx(-8).epsilon(0.02));
}

/// Boxes of 0.1 m, turned and moved by up to 30 mm: `count` on the peg, and as many around it.
std::string heap_of_boxes(int count) {
  Random random;
  const auto boxes = [&] {
    std::string text;
    for (int i = 0; i < count; ++i) {
      const Vector3 p = random.vector(0.03);
      const Vector3 turn = random.vector(3);
      std::ostringstream collision;
      collision << "<collision name='" << i << "'><pose>" << p.transpose() << " "
                << turn.transpose()
                << "</pose><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>";
      text += collision.str();
    }
    return text;
  };
  return fixed_model("heap", "0 0 0 0 0 0", boxes()) + model("peg", "0 0 0 0 0 0", boxes());
}

TEST_CASE(
    "A scene that is too much where the tool is never comes into force, and the client learns "
    "why") {
  VirtualSessionOptions options = before_wall(0.01);
  options.world = world_of(heap_of_boxes(25));
  int ticks_with_scene = 0;
  VirtualSession session(options,
                         [&](const TickRecord& tick) { ticks_with_scene += tick.scene > 0; });
  session.run(0.5);
  CHECK(ticks_with_scene == 0);
  CHECK_FALSE(session.client().has_scene());
  CHECK(session.client().scene_state().error == protocol::SceneError::kSlow);
  CHECK_THAT(session.client().scene_problem(),
             Catch::Matchers::ContainsSubstring("a tick is too short for") &&
                 Catch::Matchers::ContainsSubstring("are lengths in m"));
  CHECK(session.last().fault == Fault::kNone);
}

TEST_CASE("A server that begins anew gets the shapes again") {
  VirtualSessionOptions options = before_wall(0.01);
  options.hand = constant_push(force(2, 0));
  VirtualSession session(options);
  session.run(1);
  REQUIRE(session.client().has_scene());
  session.server(0).stop();
  session.run(1.5);
  CHECK_FALSE(session.client().has_scene());
  session.server(0).start();
  session.run(1);
  CHECK(session.client().has_scene());
  CHECK(session.servo().local_model()->scene() != nullptr);
}

}  // namespace
}  // namespace hlm::test
