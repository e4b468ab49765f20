// The bound on stiffness of a sampled and late device, on the simulated one.
#include "hlm/control/stiffness_bound.h"

#include <cmath>

#include "hlm/device/simulated_device.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kPeriod = 1e-3;  // s

/// Without dry friction, which makes more stable than the bound says.
SimulatedDeviceOptions late_by(int ticks) {
  SimulatedDeviceOptions options;
  options.dry_friction = 0;
  options.delay = ticks;
  options.max_force = options.max_torque = Range::kInfinite;
  return options;
}

HandScript nudge() {
  Push push;
  push.constant[0] = 0.1;
  return {{{0.02, push}}, AfterLastSegment::kRelease};
}

/// Whether the device, nudged once and let go, comes to rest on a coupling to a point that stands.
bool comes_to_rest(const SimulatedDeviceOptions& options, const Impedance& felt) {
  ControllerGains gains;
  gains.stiffness = felt.stiffness;
  gains.damping = felt.damping;
  const Controller coupler(ControllerKind::kVirtualCoupler, gains);
  SimulatedDevice device(options, nudge(), kPeriod);
  device.align({});
  device.enable();
  double early = 0;
  double late = 0;
  constexpr int kSteps = 8000;
  for (int step = 0; step < kSteps; ++step) {
    const DeviceState state = *device.read();
    const double x = std::abs(state.X_WD.p.x());
    if (!(x < 1)) return false;  // m
    if (step < kSteps / 8) early = std::max(early, x);
    if (step >= kSteps * 7 / 8) late = std::max(late, x);
    device.write(coupler.to_device(state, {}, {}, {}));
  }
  return late < early / 2;
}

DeviceRatings rated(const SimulatedDeviceOptions& options) {
  return SimulatedDevice(options, {}, kPeriod).ratings();
}

TEST_CASE("Just below the bound the device comes to rest, at twice the bound it shakes") {
  const int delay = GENERATE(0, 2, 5);
  const double damping = GENERATE(0.0, 30.0, 60.0);
  const SimulatedDeviceOptions device = late_by(delay);
  const double asked = 1e6;  // N/m
  // The share of a spring alone: its damper stays as it is.
  DeviceRatings damped = rated(device);
  const double lag = lag_of(damped, kPeriod);
  const double bound =
      (physical_damping(damped) + damping) * (1 - damping * lag / (2 * damped.mass)) / lag;
  CAPTURE(delay, damping, bound);
  CHECK(bearable_share(damped, {0.99 * bound, damping}, kPeriod) == 1);
  CHECK(bearable_share(damped, {asked, damping}, kPeriod) < 1);
  CHECK(comes_to_rest(device, {0.9 * bound, damping}));
  CHECK_FALSE(comes_to_rest(device, {2 * bound, damping}));
}

TEST_CASE("The share that is borne of a coupling makes it rest, on light devices too") {
  const int delay = GENERATE(0, 2, 5, 10);
  SimulatedDeviceOptions options = late_by(delay);
  options.mass = GENERATE(0.1, 0.3, 1.0);
  const Impedance asked{30'000, 60};  // N/m, N·s/m
  const double share = bearable_share(rated(options), asked, kPeriod);
  CAPTURE(delay, options.mass, share);
  CHECK(share > 0.01);
  CHECK(comes_to_rest(options, {0.9 * share * asked.stiffness, 0.9 * share * asked.damping}));
}

TEST_CASE("What the bound misses: friction stills more, a filter of the velocity less") {
  SimulatedDeviceOptions sticky = late_by(2);
  const double bound = 5 / 2.5e-3;  // N/m
  CHECK_FALSE(comes_to_rest(sticky, {1.5 * bound, 0}));
  sticky.dry_friction = 0.02;  // N, of the 0.1 N of the nudge
  CHECK(comes_to_rest(sticky, {1.5 * bound, 0}));

  SimulatedDeviceOptions filtered = late_by(2);
  const double damping = 60;  // N·s/m
  const double damped = (5 + damping) * (1 - damping * 2.5e-3 / 2) / 2.5e-3;
  CHECK(comes_to_rest(filtered, {0.9 * damped, damping}));
  filtered.velocity_cutoff = 30;  // Hz
  CHECK_FALSE(comes_to_rest(filtered, {0.9 * damped, damping}));
}

TEST_CASE("A device that exchanges seldom is as late as one that is slower by half its period") {
  DeviceRatings device = rated(late_by(0));
  CHECK(lag_of(device, kPeriod) == Approx(0.5e-3));  // s
  device.exchange_rate = 200;
  device.delay = 1e-3;
  CHECK(lag_of(device, kPeriod) == Approx(3.5e-3));
}

TEST_CASE("A device that rates no damping is taken to bear its rated stiffness at 1 kHz") {
  DeviceRatings device;
  CHECK(bearable_share(device, {1e9, 0}, kPeriod) == 1);  // nobody knows
  device.max_stiffness = 4000;
  CHECK(physical_damping(device) == 2);  // N·s/m
  CHECK(bearable_share(device, {3999, 0}, kPeriod) == 1);
  CHECK(bearable_share(device, {8000, 0}, kPeriod) == Approx(0.5).epsilon(1e-6));
}

TEST_CASE("What a device does not bear is lowered, and said in one sentence") {
  const DeviceRatings late = rated(late_by(20));
  ControllerGains gains;
  LocalModelParameters contacts;
  const auto coupling =
      lower_stiffness(ControllerKind::kFourChannel, late, kPeriod, gains, contacts);
  REQUIRE(coupling);
  CAPTURE(*coupling);
  CHECK_THAT(*coupling, ContainsSubstring("a coupling of 1500 N/m and 30 N·s/m is too stiff for "
                                          "this device, whose force comes 20.5 ms after") &&
                            ContainsSubstring("--keep-stiffness"));
  CHECK(gains.stiffness < 1500);
  CHECK(gains.angular_stiffness == Approx(gains.stiffness / 1500));
  CHECK(contacts.max_hand_stiffness == Range::kInfinite);
  CHECK_FALSE(lower_stiffness(ControllerKind::kFourChannel, late, kPeriod, gains, contacts));

  contacts.damping = 0;
  const auto walls = lower_stiffness(ControllerKind::kDirect, late, kPeriod, gains, contacts);
  REQUIRE(walls);
  CAPTURE(*walls);
  CHECK(contacts.max_hand_stiffness == Approx(0.7 * 5 / 0.0205).epsilon(1e-6));  // of b / lag, N/m
  CHECK_THAT(*walls, ContainsSubstring("contacts of 16000 N/m together"));
}

TEST_CASE("On a punctual device the usual settings stay as they are") {
  for (const Word<ControllerKind>& kind : kWords<ControllerKind>) {
    ControllerGains gains;
    LocalModelParameters contacts;
    CAPTURE(kind.name);
    CHECK_FALSE(lower_stiffness(kind.value, rated(late_by(0)), kPeriod, gains, contacts));
  }
}

}  // namespace
}  // namespace hlm::server
