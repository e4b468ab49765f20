// How stiff a floor can be that is felt through three engines at 60 frames a second: by the force
// of the engine's own contact held between frames, as is usual, and by this project's coupling. The
// same simulated device, hand and frames, in virtual time.
//
//   held_force        # prints a table; status 1 if a ratio is below 20
//
// A hand pushes with 2 N from just above the floor. A stiffness counts as stable if the device
// comes to rest: from 4 to 6 s its force changes by no more than 0.2 N, from three heights, hence
// three phases between hand and frames. The limit is where that ends in a scan by factors of two,
// then bisected to 10 %. The held force is that of a spring and the damper that suits it best.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include <spdlog/fmt/fmt.h>

#include "tests/examples/floors.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

constexpr double kPush = 2;          // N
constexpr double kFrame = 1.0 / 60;  // s
constexpr double kTick = 1e-3;       // s
constexpr double kStart = 0.5;       // s: the hand waits until all are there.
constexpr double kDuration = 6;      // s
constexpr double kJudgedFrom = 4;    // s
constexpr double kRipple = 0.2;      // N
constexpr double kLeast = 125;       // N/m, ends of the search
constexpr double kMost = 256e3;      // N/m
constexpr double kPrecision = 1.1;   // Ratio of the stiffnesses between which the limit lies.
constexpr double kClaimedRatio = 20;
constexpr std::array kHeights{0.0005, 0.0010, 0.0015};      // m, of the ball above the floor
constexpr std::array kFrictions{0.0, 0.2};                  // N, dry, of the device
constexpr std::array kDampers{0.0, 5.0, 10.0, 30.0, 60.0};  // N·s/m, of the held force

enum class Coupling { kHeldForce, kDirect, kFourChannels };

struct Trial {
  Coupling coupling;
  double damper = 0;    ///< Of the held force, N·s/m.
  double friction = 0;  ///< Of the device, N.
};

server::ServoOptions servo_options(const Trial& trial, double stiffness) {
  constexpr double kFar = 1e9;
  server::ServoOptions servo;
  servo.rate = 1 / kTick;
  servo.limits = {.max_force = kFar,
                  .max_torque = kFar,
                  .max_force_rate = kFar,
                  .max_torque_rate = kFar,
                  .max_power = kFar,
                  .max_turning_power = kFar,
                  .max_energy = kFar};
  servo.handle = {.max_speed = kFar, .max_rate = kFar, .workspace = kFar};
  servo.local_model.stiffness = stiffness;
  switch (trial.coupling) {
    case Coupling::kHeldForce:  // Of a spring from the device to where the engine puts the tool.
      servo.controller = ControllerKind::kEngineForce;
      servo.gains = {.stiffness = stiffness,
                     .damping = trial.damper,
                     .angular_stiffness = 0,
                     .angular_damping = 0};
      break;
    case Coupling::kDirect:
      servo.controller = ControllerKind::kDirect;
      break;
    case Coupling::kFourChannels:
      break;
  }
  return servo;
}

ToolDescription ball() {
  Link link;
  link.joint = JointType::kFree;
  link.mass = 0.1;
  link.I_LCom = 0.4 * link.mass * kBallRadius * kBallRadius * Matrix3::Identity();
  ToolDescription tool;
  tool.links.push_back(link);
  tool.length = 2 * kBallRadius;
  return tool;
}

server::HandScript hand() {
  server::HandScript script = constant_push(force(0, 0, -kPush));
  script.segments.insert(script.segments.begin(), {kStart, server::Push{}});
  return script;
}

/// Whether the device comes to rest on the floor.
bool rests(Floor& floor, const Trial& trial, double stiffness, double height) {
  VirtualSessionOptions options;
  options.servo = servo_options(trial, stiffness);
  options.link = {};
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.dry_friction = trial.friction;
  VirtualServer server(options, hand(), 1);
  double least = 1e9;
  double most = -1e9;
  VirtualClock clock(
      [&](double now) {
        const server::TickRecord& tick = *server.tick(now);
        if (now < kJudgedFrom) return;
        least = std::min(least, tick.F_command[2]);
        most = std::max(most, tick.F_command[2]);
      },
      kTick);
  Configuration q(7);
  q << 0, 0, kBallRadius + height, 1, 0, 0, 0;
  Velocity v = Velocity::Zero(6);
  HapticClient client(
      server.network().client(),
      {.server = MemoryNetwork::kServer, .tool = ball(), .q = q, .epsilon = kEpsilon, .nonce = 1});
  for (int frame = 1; clock.now() < kDuration; ++frame) {
    const HapticClient::Inbox inbox = client.poll(clock.now());
    if (inbox.state != nullptr) {
      q = inbox.state->q;
      v = inbox.state->v;
    }
    if (trial.coupling == Coupling::kHeldForce) {
      const double depth = floor.depth(q.head<3>());
      Configuration at_surface = q;
      at_surface[2] += depth;
      client.sample(clock.now(), at_surface, depth > 0 ? Velocity(Velocity::Zero(6)) : v, kFrame);
      client.send(clock.now(), {});
    } else {
      client.sample(clock.now(), q, v, kFrame);
      client.send(clock.now(), floor.near(q.head<3>()));
    }
    clock.sleep_until(frame * kFrame);
  }
  return least > 0 && most - least <= kRipple;
}

/// N/m; 0 where kLeast is not stable.
double largest_stable(Floor& floor, const Trial& trial) {
  const auto stable = [&](double stiffness) {
    return std::ranges::all_of(
        kHeights, [&](double height) { return rests(floor, trial, stiffness, height); });
  };
  double low = 0;
  double high = kLeast;
  for (; high <= kMost && stable(high); high *= 2) low = high;
  while (low > 0 && high <= kMost && high > kPrecision * low) {
    const double middle = std::sqrt(low * high);
    (stable(middle) ? low : high) = middle;
  }
  return low;
}

/// "61 kN/m (64 ×)", with ">" at the end of the search.
std::string compared(double stiffness, double held) {
  const char* beyond = stiffness >= kMost ? "> " : "";
  return fmt::format("{}{:.0f} kN/m ({}{:.0f} ×)", beyond, stiffness / 1e3, beyond,
                     stiffness / held);
}

/// Prints one row. Whether the claim holds.
bool compare(Floor& floor, double friction) {
  double held = 0;
  double damper = 0;
  for (const double each : kDampers) {
    const double found = largest_stable(floor, {Coupling::kHeldForce, each, friction});
    if (found > held) damper = each;
    held = std::max(held, found);
  }
  const double direct = largest_stable(floor, {Coupling::kDirect, 0, friction});
  const double whole = largest_stable(floor, {Coupling::kFourChannels, 0, friction});
  fmt::print("| {} | {} N | {:.2f} kN/m, with {} N·s/m | {} | {} |\n", floor.engine(), friction,
             held / 1e3, damper, compared(direct, held), compared(whole, held));
  std::fflush(stdout);
  return held > 0 && direct >= kClaimedRatio * held && whole >= kClaimedRatio * held;
}

}  // namespace
}  // namespace hlm::test

int main() {
  using namespace hlm::test;
  std::puts(
      "| engine | dry friction of the device | its force, held | local model, direct | "
      "local model, four channels |\n|---|---|---|---|---|");
  MujocoFloor mujoco;
  BulletFloor bullet;
  OdeFloor ode;
  bool holds = true;
  for (Floor* floor : std::initializer_list<Floor*>{&mujoco, &bullet, &ode}) {
    for (const double friction : kFrictions) holds = compare(*floor, friction) && holds;
  }
  return holds ? 0 : 1;
}
