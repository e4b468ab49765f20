// Devices that do not measure the hand, and devices that are late, in whole sessions in virtual
// time.
#include <algorithm>
#include <cmath>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/haptic_server/device/hand_script.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm {
namespace {

using server::TickRecord;
using test::constant_push;
using test::force;
using test::VirtualSession;
using test::VirtualSessionOptions;

constexpr double kPush = 2;       // N
constexpr double kPeriod = 1e-3;  // s

/// As real devices: encoder steps of 0.05 mm, no sensor of the hand.
server::SimulatedDeviceOptions without_sensor() {
  server::SimulatedDeviceOptions device;
  device.position_step = 5e-5;
  device.angle_step = 5e-4;
  device.velocity_cutoff = 100;
  device.measures_hand_wrench = false;
  return device;
}

/// Smallest and largest of a signal.
struct Span {
  double least = 1e300;
  double most = -1e300;
  void add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  double middle() const { return (least + most) / 2; }
  double width() const { return most - least; }
};

struct Rest {
  Span force;            ///< Commanded, N.
  Span place;            ///< Of the handle, y, m.
  Span estimate;         ///< Of the hand's force, N.
  double speed = 0;      ///< Largest of the handle since the beginning, m/s.
  bool limited = false;  ///< By the passivity controller.
  bool fault = false;
};

/// The last second of `duration` s under a push onto the testbed's bottom wall.
Rest press(const VirtualSessionOptions& options, double duration = 5) {
  Rest rest;
  VirtualSession session(options, [&](const TickRecord& record) {
    rest.speed = std::max(rest.speed, record.V_WD.head<3>().norm());
    rest.limited |= record.limit == ForceLimit::kEnergy;
    rest.fault |= record.fault != Fault::kNone;
    if (record.time < duration - 1) return;
    rest.force.add(-record.F_command[1]);
    rest.place.add(record.X_WD.p.y());
    rest.estimate.add(record.F_hand[1]);
  });
  session.run(duration);
  return rest;
}

VirtualSessionOptions pressing(const server::SimulatedDeviceOptions& device) {
  VirtualSessionOptions options;
  options.device = device;
  options.hand = constant_push(force(0, kPush));
  return options;
}

TEST_CASE("A hand that is observed presses on a wall as one that is measured") {
  VirtualSessionOptions options = pressing(without_sensor());
  options.device.dry_friction = 0;
  options.device.position_step = options.device.angle_step = 0;
  options.device.delay = GENERATE(0, 1, 3);
  const Rest observed = press(options);
  options.device.measures_hand_wrench = true;
  const Rest measured = press(options);
  CAPTURE(options.device.delay, observed.force.middle(), observed.force.width());
  CHECK_FALSE(observed.fault);
  CHECK_FALSE(observed.limited);
  CHECK(observed.force.middle() == Approx(kPush).epsilon(0.02));
  CHECK(observed.force.width() < 0.02 * kPush);
  CHECK(observed.estimate.middle() == Approx(kPush).epsilon(0.02));
  CHECK(observed.place.middle() == Approx(measured.place.middle()).margin(1e-4));  // m
}

TEST_CASE("With encoder steps and friction it rests, within what friction holds") {
  VirtualSessionOptions options = pressing(without_sensor());
  options.device.delay = GENERATE(0, 1, 3);
  options.servo.rate = GENERATE(1000.0, 4000.0);
  const Rest rest = press(options, 4);
  CAPTURE(options.device.delay, options.servo.rate, rest.force.middle(), rest.force.width());
  CHECK_FALSE(rest.fault);
  CHECK_FALSE(rest.limited);
  CHECK(rest.force.middle() == Approx(kPush).margin(options.device.dry_friction));
  CHECK(rest.place.width() < 1e-4);  // m
}

TEST_CASE("A mass that is known by a third too small or too large presses no differently") {
  VirtualSessionOptions options = pressing(without_sensor());
  options.observer.mass = GENERATE(0.67, 1.33);
  const Rest rest = press(options);
  CAPTURE(*options.observer.mass, rest.force.middle(), rest.speed);
  CHECK_FALSE(rest.fault);
  CHECK(rest.force.middle() == Approx(kPush).margin(options.device.dry_friction));
  CHECK(rest.speed < 1);  // m/s
}

/// How far the handle still sways between 5 and 6 s, m, drawn 20 mm aside in free motion.
double sway_in(const server::Grip& grip, bool measured = false) {
  server::Reach aside;
  aside.position = {0.02, 0, 0};
  aside.relative = true;
  aside.grip = grip;
  VirtualSessionOptions options;
  options.device = without_sensor();
  options.device.dry_friction = options.device.position_step = options.device.angle_step = 0;
  options.hand = {{{0.2, aside}}, server::AfterLastSegment::kHold};
  options.device.measures_hand_wrench = measured;
  Span x;
  VirtualSession session(options, [&](const TickRecord& record) {
    if (record.time > 5) x.add(record.X_WD.p.x());
  });
  session.run(6);
  return x.width();
}

TEST_CASE(
    "In a hand's grip an observed device is quiet, on a stiff, undamped clamp it sways for long") {
  CHECK(sway_in({}) < 1e-6);                                // m
  CHECK(sway_in({.stiffness = 500, .damping = 5}) < 1e-5);  // m
  const server::Grip clamp{.stiffness = 4000, .damping = 0.2, .max_force = 100};
  CHECK(sway_in(clamp, true) < 1e-6);  // measured
  CHECK(sway_in(clamp) > 1e-3);
}

TEST_CASE(
    "In a session the observed hand's work explains what the port gives, as a measured one's") {
  VirtualSessionOptions options;
  options.device = without_sensor();
  options.device.delay = 1;
  options.hand = server::read_hand_script(std::string(HLM_WORLDS) + "/hands/session.toml");
  options.link.delay = 0.02;
  double least = 0;
  double net = 0;
  bool limited = false;
  bool fault = false;
  VirtualSession session(options, [&](const TickRecord& record) {
    const double now = record.port.given - record.port.taken - record.port.explained;
    least = std::min(least, now);
    net = std::max(net, now - least);
    limited |= record.limit == ForceLimit::kEnergy;
    fault |= record.fault != Fault::kNone;
  });
  session.run(36);
  CAPTURE(net);
  CHECK(session.last().hand_observed);
  CHECK_FALSE(fault);
  CHECK_FALSE(limited);
  CHECK(net < 0.25);  // J, of 0.5
}

TEST_CASE(
    "Directly coupled, a late device is quiet on a wall that it bears and shakes on twice that") {
  const int delay = GENERATE(0, 2, 5);
  VirtualSessionOptions options = pressing({});
  options.world = test::world_of(  // Nothing but a wall, met without a blow.
      test::fixed_model("wall", "0 0.0701 0 0 0 0", test::box("2 0.1 0.04")) +
      test::model("peg", "0 0 0 0 0 0", test::box("0.08 0.04 0.04"),
                  "<haptic:tool_joint>planar</haptic:tool_joint>"));
  options.device.delay = delay;
  options.device.dry_friction = 0;
  options.servo.controller = ControllerKind::kDirect;
  server::LocalModelParameters& contacts = options.servo.local_model;
  contacts.stiffness = 40'000;
  contacts.damping = 0;
  const server::DeviceRatings rated =
      server::SimulatedDevice(options.device, {}, kPeriod).ratings();
  const server::Impedance felt = felt_impedance(ControllerKind::kDirect, {}, contacts);
  const double bound =
      bearable_share(server::translation_of(rated, kPeriod), felt) * felt.stiffness;
  const auto sentence =
      lower_stiffness(ControllerKind::kDirect, rated, kPeriod, options.servo.gains, contacts);
  REQUIRE(sentence);
  CHECK(contacts.max_hand_stiffness > 0.45 * bound);
  const Rest below = press(options, 20);
  contacts.max_hand_stiffness = 2 * bound;
  contacts.max_hand_angular_stiffness = Range::kInfinite;
  const Rest above = press(options, 8);
  CAPTURE(*sentence, below.force.width(), above.force.width());
  CHECK(below.force.width() < 0.05 * kPush);
  CHECK(above.force.width() > kPush);
}

TEST_CASE(
    "With four channels a coupling that a late device does not bear is lowered until it rests") {
  VirtualSessionOptions options = pressing({});
  options.device.delay = 40;  // ms at 1 kHz
  options.device.dry_friction = 0;
  const Rest as_asked = press(options, 8);
  const auto sentence = lower_stiffness(options.servo.controller,
                                        server::SimulatedDevice(options.device, {}, 1e-3).ratings(),
                                        1e-3, options.servo.gains, options.servo.local_model);
  REQUIRE(sentence);
  const Rest lowered = press(options, 8);
  CAPTURE(*sentence, as_asked.force.width(), lowered.force.width());
  CHECK(as_asked.force.width() > kPush);
  CHECK(lowered.force.width() < 0.1 * kPush);
}

}  // namespace
}  // namespace hlm
