// The hand in a world whose time is slow or stands still: server tick and client frame in virtual
// time.
#include <cmath>

#include "hlm/haptic_server/device/hand_script.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

constexpr double kWeight = 0.3 * 9.81;  // N, of the cube

VirtualSessionOptions playing(const std::string& scene, const std::string& tool) {
  VirtualSessionOptions options;
  options.world = repository_world(scene + ".sdf");
  options.tool = tool;
  options.hand =
      scene == "testbed"
          ? constant_push(force(0, 0.8))
          : server::read_hand_script(std::string(HLM_WORLDS) + "/hands/" + scene + ".toml");
  if (scene == "lift") options.device.freedom = server::DeviceFreedom::kSpatial;
  options.rate_low = options.rate_high = 60;
  options.frame.shapes = GENERATE(false, true);
  return options;
}

/// The largest change of the commanded force from tick to tick since the last look, N.
struct Jumps {
  void add(const server::TickRecord& record) {
    const Vector3 force = record.F_command.head<3>();
    if (known) largest = std::max(largest, (force - last).norm());
    last = force;
    known = true;
  }
  double take() { return std::exchange(largest, 0); }

  Vector3 last = Vector3::Zero();
  bool known = false;
  double largest = 0;
};

TEST_CASE("The world's time stands still, goes on by one frame, and at a quarter of the pace") {
  VirtualSession session(playing("push", "pusher"));
  session.run(3);
  const ve::WorldPace& pace = session.environment().pace;
  CHECK(pace.time() == Approx(3).margin(0.02));
  session.frame().pace = 0;
  session.run(0.5);
  const double still = pace.time();
  session.run(1);
  CHECK(pace.time() == still);
  session.environment().pace.step();
  session.run(0.5);
  CHECK(pace.time() == Approx(still + 1.0 / 60).epsilon(1e-9));
  session.frame().pace = 0.25;
  session.run(0.5);
  const double slow = pace.time();
  session.run(2);
  CHECK(pace.time() - slow == Approx(0.5).epsilon(0.02));
}

TEST_CASE("A cube that is held weighs the same at any pace of its world") {
  VirtualSession session(playing("lift", "fork"));
  session.run(5.2);
  session.frame().pace = GENERATE(1.0, 0.25, 0.1);
  session.run(0.6);
  double sum = 0;
  int count = 0;
  session.observe(0, [&](const server::TickRecord& record) {
    sum += record.F_env[2];
    ++count;
  });
  session.run(0.5);
  CAPTURE(session.frame().pace, session.frame().shapes);
  CHECK(sum / count == Approx(-kWeight).epsilon(0.02));
}

TEST_CASE(
    "A hand at rest does not feel that its world stands still, goes on by a frame and goes on") {
  const bool carries = GENERATE(true, false);
  VirtualSessionOptions options = carries ? playing("lift", "fork") : playing("testbed", "peg");
  CAPTURE(carries, options.frame.shapes);
  VirtualSession session(options);
  session.run(carries ? 5.2 : 4);
  Jumps jumps;
  session.observe(0, [&](const server::TickRecord& record) { jumps.add(record); });
  session.frame().pace = 0;
  session.run(0.6);
  session.environment().pace.step();
  session.run(0.2);
  session.frame().pace = 1;
  session.run(0.6);
  CHECK(jumps.last.norm() > 0.5);  // N
  CHECK(jumps.largest < 0.001);    // N, of the force from tick to tick
}

TEST_CASE("A world that stands still is no blow to a hand that moves a body in it") {
  const bool carries = GENERATE(true, false);
  VirtualSessionOptions options = carries ? playing("lift", "fork") : playing("push", "pusher");
  CAPTURE(carries, options.frame.shapes);
  VirtualSession session(options);
  session.run(carries ? 3.5 : 2.8);
  Jumps jumps;
  session.observe(0, [&](const server::TickRecord& record) { jumps.add(record); });
  session.frame().pace = 0;
  session.run(0.5);
  CHECK(jumps.largest < 0.35);  // N; 0.22 in the cube's case, 0.13 in the brick's
}

/// Draws a body by a point in it for 2 s.
void pull(VirtualSession& session, int body, const Vector3& way) {
  const Vector3 target = session.environment().world.X_WB(body).p + way;
  session.frame().pull = {.body = body, .p_B = {0, 0.01, 0}, .target_W = target};
  session.run(2);
}

TEST_CASE("A person's mouse drags a body, up to what stops it, with 10 N at most") {
  VirtualSessionOptions options = playing("push", "pusher");
  options.hand = {};
  VirtualSession session(options);
  session.run(0.5);
  const ve::World& world = session.environment().world;
  const auto body_named = [&](const char* name) {
    const auto& bodies = world.description().bodies;
    const auto found = std::ranges::find(bodies, name, &ve::BodyDescription::name);
    REQUIRE(found != bodies.end());
    return static_cast<int>(found - bodies.begin());
  };
  for (const char* const name : {"brick::body", "heavy::body"}) {
    const int body = body_named(name);
    const Vector3 before = world.X_WB(body).p;
    pull(session, body, {0, -0.1, 0});
    CHECK(before.y() - world.X_WB(body).p.y() == Approx(0.1).margin(0.02));  // m
  }
  const int brick = body_named("brick::body");
  pull(session, brick, {0, 0.1, 0});
  pull(session, brick, {1, 0, 0});  // against the post, whose near side is at 0.25 m
  CHECK(world.X_WB(brick).p.x() == Approx(0.22).margin(0.005));
  CHECK(session.environment().pulled.head<3>().norm() == Approx(10).epsilon(0.01));  // N
  session.frame().pull.reset();
  session.run(0.1);
  CHECK(session.environment().pulled.isZero(0));
}

}  // namespace
}  // namespace hlm::test
