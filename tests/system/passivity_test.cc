// What the passivity controller at the device port costs in feel: whole sessions in virtual time,
// with it and without.
#include <algorithm>
#include <vector>

#include "hlm/haptic_server/device/hand_script.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm {
namespace {

using server::TickRecord;
using test::constant_push;
using test::force;
using test::repository_world;
using test::VirtualSession;
using test::VirtualSessionOptions;

struct Scene {
  const char* name;
  VirtualSessionOptions options;
  double duration;  // s
};

VirtualSessionOptions scene(const char* world, const char* tool, const char* hand, bool spatial) {
  VirtualSessionOptions options;
  options.world = repository_world(std::string(world) + ".sdf");
  options.tool = tool;
  options.hand = server::read_hand_script(std::string(HLM_WORLDS) + "/hands/" + hand + ".toml");
  if (spatial) options.device.freedom = server::DeviceFreedom::kSpatial;
  options.link.delay = 0.02;
  return options;
}

VirtualSessionOptions pushed(const Wrench& constant, const Wrench& amplitude, double frequency) {
  VirtualSessionOptions options;
  server::Push push;
  push.constant = constant;
  push.amplitude = amplitude;
  push.frequency = frequency;
  options.hand = {{{1.0, push}}, server::AfterLastSegment::kHold};
  options.link.delay = 0.02;
  return options;
}

std::vector<Scene> scenes() {
  return {{"press 2 N", pushed(force(0, 2), force(0, 0), 0), 6},
          {"slide under 2 N", pushed(force(0, 2), force(2, 0), 0.5), 8},
          {"collisions", pushed(force(0, 0.5), force(0, 4), 2), 8},
          {"session", scene("testbed", "peg", "session", false), 36},
          {"push", scene("push", "pusher", "push", false), 31},
          {"lift", scene("lift", "fork", "lift", true), 37},
          {"stack", scene("stack", "finger", "stack", true), 24},
          {"door", scene("door", "finger", "door", false), 25},
          {"linkage", scene("linkage", "arm", "linkage", false), 25},
          {"corner", scene("corner", "arm", "corner", false), 27},
          {"scissors", scene("scissors", "scissors", "scissors", false), 25}};
}

struct Outcome {
  std::vector<Wrench> commands;
  double given = 0;    // J
  double taken = 0;    // J
  double brought = 0;  // J
  double net = 0;      // J: most given beyond taken and explained, over any stretch of time
  bool limited = false;
  bool fault = false;
};

Outcome play(const Scene& scene, double budget) {
  Outcome outcome;
  double least = 0;
  VirtualSessionOptions options = scene.options;
  options.servo.limits.max_energy = budget;
  VirtualSession session(options, [&](const TickRecord& record) {
    outcome.commands.push_back(record.F_command);
    const double net = record.port.given - record.port.taken - record.port.explained;
    least = std::min(least, net);
    outcome.net = std::max(outcome.net, net - least);
    outcome.limited |= record.limit == ForceLimit::kEnergy;
    outcome.fault |= record.fault != Fault::kNone;
    outcome.given = record.port.given;
    outcome.taken = record.port.taken;
    outcome.brought = record.brought;
  });
  session.run(scene.duration);
  return outcome;
}

TEST_CASE("In the scenes the passivity controller changes nothing: no tick has another force") {
  const server::LimiterOptions limits;
  for (const Scene& scene : scenes()) {
    const Outcome with = play(scene, limits.max_energy);
    const Outcome without = play(scene, 1e6);
    UNSCOPED_INFO(scene.name << ": given " << with.given << " J, taken " << with.taken
                             << " J, brought by updates " << with.brought
                             << " J, beyond taken and explained " << without.net << " J");
    CHECK_FALSE(with.fault);
    CHECK_FALSE(with.limited);
    const bool same = with.commands == without.commands;
    CHECK(same);
    CHECK(without.net < 0.8 * limits.max_energy);
  }
}

/// How deep the handle is in the bottom wall of the testbed, m.
double depth(const VirtualSession& session) { return session.last().X_WD.p.y() - 0.124; }

/// Pauses of the client while a hand of 200 N/m goes 30 mm into a wall, at no cost: nothing pushes
/// it.
struct Pauses {
  VirtualSession session;
  double pressed = 0;  ///< Depth of the handle before the first, m.
  double net = 0;      ///< Most given beyond taken and explained, J.
  double least = 0;

  Pauses() : session(options(), [this](const TickRecord& record) { count(record); }) {
    session.run(3);
    pressed = depth(session);
  }

  static VirtualSessionOptions options() {
    server::Reach into_wall;
    into_wall.position = {-0.05, 0.154, 0};
    into_wall.rotation = {0, 0, 0};
    into_wall.grip = {
        .stiffness = 200, .damping = 10, .angular_stiffness = 2, .angular_damping = 0.08};
    VirtualSessionOptions options;
    options.hand = {{{1.0, into_wall}}, server::AfterLastSegment::kHold};
    return options;
  }

  void count(const TickRecord& record) {
    const double now = record.port.given - record.port.taken - record.port.explained;
    least = std::min(least, now);
    net = std::max(net, now - least);
  }
};

TEST_CASE(
    "A wall pushes a hand out that went in while the client paused, but gives no more than its "
    "tank") {
  Pauses pauses;
  VirtualSession& session = pauses.session;
  const double pause = GENERATE(0.4, 3.0);  // s
  for (int i = 1; i <= 20; ++i) {
    session.run_server_alone(pause);
    const double deepest = depth(session);
    session.run(1.5);
    INFO("pause " << i << " of " << pause << " s: " << 1e3 * pauses.pressed << " mm before, "
                  << 1e3 * deepest << " in it, " << 1e3 * depth(session) << " after; tank "
                  << session.last().port.tank << " J");
    if (i == 1) CHECK(depth(session) == Approx(pauses.pressed).margin(1e-3));  // m
    CHECK(depth(session) < deepest + 1e-3);  // It holds, and gives way no further.
    CHECK(session.last().fault == Fault::kNone);
    CHECK(pauses.net <= 0.6);  // J
  }
}

}  // namespace
}  // namespace hlm
