// Force and separation where contacts go, walls move and walls come late: server and client
// together, in virtual time (docs/method.md 2, 12).
#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

using server::TickRecord;

TEST_CASE("A ball that is dragged off an edge loses its force by 0.5 N a tick at most") {
  const double delay = GENERATE(0.0, 0.02);  // s each way
  VirtualSessionOptions options;
  options.world = world_of(
      fixed_model("table", "0 0.1 0 0 0 0", box("0.1 0.1 0.1")) +
      model("ball", "0 0.035 0 0 0 0",
            "<collision name='ball'><geometry><sphere><radius>0.01</radius></sphere></geometry>"
            "</collision>",
            "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.tool = "ball";
  options.frame.report_friction = {};
  options.servo.local_model.static_friction = options.servo.local_model.kinetic_friction = 0;
  options.device.dry_friction = 0;
  options.link = {.delay = delay};
  // Onto the table's side at y = 0.05, then along it.
  options.hand = constant_push(force(0, 3));
  options.hand.segments.push_back({1.0, server::Push{.constant = force(1.5, 3)}});
  std::vector<TickRecord> ticks;
  VirtualSession session(options, [&](const TickRecord& tick) { ticks.push_back(tick); });
  session.run(1);
  REQUIRE(session.last().F_env[1] == Approx(-3).epsilon(0.02));
  ticks.clear();
  session.run(1);
  REQUIRE(session.last().X_WP.p.x() > 0.06);  // m: past the edge
  REQUIRE(session.last().F_env.norm() < 1e-6);
  double largest_fall = 0;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const auto size = [&](std::size_t at) { return ticks[at].F_env.head<3>().norm(); };
    largest_fall = std::max(largest_fall, size(i - 1) - size(i));
  }
  CHECK(largest_fall <= 0.5 + 1e-6);  // N
  CHECK(largest_fall > 0.05);         // N: it fell off
}

TEST_CASE("A wall that comes at 0.2 m/s is where it is at each tick, to half a tick's way") {
  const double delay = GENERATE(0.0, 0.02);  // s each way
  constexpr double kSpeed = 0.2;             // m/s
  constexpr int kWall = 1;
  VirtualSessionOptions options;
  options.world = world_of(model("tool", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>") +
                           model("wall", "0.11 0 0 0 0 0", box("0.02 0.1 0.1")));
  options.tool = "tool";
  options.link = {.delay = delay};
  options.rate_low = options.rate_high = 50;
  options.frame = {.shapes = false, .epsilon = 0.09, .push_by_following = true};
  VirtualSession* running = nullptr;
  Vector3 found;             // m: the wall as the newest frame has it,
  double found_at = 0;       // s, since then.
  double largest_error = 0;  // m
  int compared = 0;
  VirtualSession session(options, [&](const TickRecord& tick) {
    const Vector3 wall = running->environment().world.X_WB(kWall).p;
    if (wall != found) found_at = tick.time;
    found = wall;
    if (running->environment().world.V_WB(kWall).isZero(0) || tick.active_contacts > 0) return;
    if (tick.predicted_contacts == 0 || found.x() > 0.09 || found.x() < 0.04) return;
    const double gap = found.x() - 0.02 - kSpeed * (tick.time - found_at);
    largest_error = std::max(largest_error, std::abs(tick.smallest_separation - gap));
    ++compared;
  });
  running = &session;
  session.run(0.5);
  session.environment().world.add_wrench(kWall, force(-kSpeed * 50, 0));  // In one frame.
  session.run(0.4);
  CHECK(compared > 150);
  // m: half of a round trip of an odd number of ticks is known to half a tick, 0.1 mm.
  CHECK(largest_error < (delay == 0 ? 1e-6 : 1.01e-4));
}

TEST_CASE("Without prediction too a pressed wall is where it is a second after it was met") {
  // N, and m from the wall when the hand begins to push; farther, 5 N come in deeper than the tank
  // of energy pays for.
  const auto [push, gap] = GENERATE(
      table<double, double>({{0.5, 0.003}, {0.5, 0.02}, {2.0, 0.003}, {2.0, 0.02}, {5.0, 0.003}}));
  CAPTURE(push, gap);
  VirtualSessionOptions options;
  options.world = world_of(model("tool", "0 0 0 0 0 0", box("0.02 0.02 0.02"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>") +
                           fixed_model("wall", "0 0.11 0 0 0 0", box("0.2 0.2 0.2")));
  options.world.bodies[0].X_WB.p.y() = -gap;
  options.tool = "tool";
  options.device.dry_friction = 0;
  options.frame.epsilon = 0;
  options.link = {.delay = 0.02};
  options.hand = constant_push(force(0, 0));
  options.hand.segments = {{0.5, server::Push{}}, {1, server::Push{.constant = force(0, push)}}};
  double met = -1;  // s
  VirtualSession* running = nullptr;
  VirtualSession session(options, [&](const TickRecord& tick) {
    if (met < 0 && tick.active_contacts > 0) met = running->now();
  });
  running = &session;
  while (met < 0 && session.now() < 5) session.run(0.02);
  REQUIRE(met > 0);
  session.run(1);
  const double at_rest = push / 2 / 4000;  // m: two contacts bear the push
  CHECK(session.last().F_env[1] == Approx(-push).epsilon(0.05));
  CHECK(session.last().X_WP.p.y() == Approx(at_rest).margin(1e-4));
}

}  // namespace
}  // namespace hlm::test
