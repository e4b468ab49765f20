// The bound on stiffness of a sampled and late device, on the simulated one.
#include "hlm/haptic_server/control/stiffness_bound.h"

#include <cmath>
#include <numbers>

#include "hlm/haptic_server/device/simulated_device.h"
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

TEST_CASE("Just below the bound the device comes to rest, just above it shakes") {
  const SimulatedDeviceOptions device = late_by(GENERATE(0, 2, 5, 10, 20, 50));
  const double ratio = GENERATE(0.0, 5e-3, 20e-3);  // s: of damping over stiffness
  const Impedance asked{1e6, 1e6 * ratio};
  const double bound = bearable_share(translation_of(rated(device), kPeriod), asked);
  CAPTURE(device.delay, ratio, bound * asked.stiffness);
  CHECK(bound < 1);
  CHECK(comes_to_rest(device, {0.9 * bound * asked.stiffness, 0.9 * bound * asked.damping}));
  CHECK_FALSE(comes_to_rest(device, {1.2 * bound * asked.stiffness, 1.2 * bound * asked.damping}));
}

TEST_CASE("Without damping, and with little of it, the bound is that of Colgate and of Gil") {
  const DeviceRatings late = rated(late_by(20));
  const double lag = lag_of(late, kPeriod);
  const Handle handle = translation_of(late, kPeriod);
  CHECK(1e6 * bearable_share(handle, {1e6, 0}) == Approx(late.damping / lag).epsilon(0.05));
  const double ratio = 5e-3;  // s
  CHECK(1e6 * bearable_share(handle, {1e6, 1e6 * ratio}) ==
        Approx(late.damping / (lag - ratio)).epsilon(0.1));
}

TEST_CASE("The share that is borne of a coupling makes it rest, on light devices too") {
  SimulatedDeviceOptions options = late_by(GENERATE(0, 2, 5, 10));
  options.mass = GENERATE(0.1, 0.3, 1.0);
  const Impedance asked{30'000, 60};  // N/m, N·s/m
  const double share = bearable_share(translation_of(rated(options), kPeriod), asked);
  CAPTURE(options.delay, options.mass, share);
  CHECK(share > 0.01);
  CHECK(comes_to_rest(options, {0.9 * share * asked.stiffness, 0.9 * share * asked.damping}));
}

TEST_CASE("A velocity that comes later than the pose is taken into account where it is told") {
  SimulatedDeviceOptions filtered = late_by(2);
  filtered.velocity_cutoff = 30;  // Hz
  const Impedance asked{20'000, 60};
  DeviceRatings told = rated(filtered);
  const auto share = [&] { return 0.8 * bearable_share(translation_of(told, kPeriod), asked); };
  const auto rests = [&] {
    return comes_to_rest(filtered, {share() * asked.stiffness, share() * asked.damping});
  };
  CHECK_FALSE(rests());
  told.velocity_lag = 1 / (2 * std::numbers::pi * filtered.velocity_cutoff);
  CHECK(rests());
}

TEST_CASE("What the bound misses: friction stills more") {
  SimulatedDeviceOptions sticky = late_by(2);
  const double bound = 5 / 2.5e-3;  // N/m
  CHECK_FALSE(comes_to_rest(sticky, {1.5 * bound, 0}));
  sticky.dry_friction = 0.02;  // N, of the 0.1 N of the nudge
  CHECK(comes_to_rest(sticky, {1.5 * bound, 0}));
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
  CHECK(bearable_share(translation_of(device, kPeriod), {1e9, 0}) == 1);  // nobody knows
  device.max_stiffness = 4000;
  const Handle handle = translation_of(device, kPeriod);
  CHECK(handle.damping == 2);  // N·s/m
  CHECK(bearable_share(handle, {3999, 0}) == 1);
  CHECK(bearable_share(handle, {8000, 0}) == Approx(0.5).epsilon(1e-6));
  device.max_angular_stiffness = 10;
  CHECK(rotation_of(device, kPeriod).damping == Approx(5e-3));  // N·m·s/rad
}

TEST_CASE("What a device does not bear is lowered, and said in one sentence") {
  const DeviceRatings late = rated(late_by(20));
  ControllerGains gains;
  LocalModelParameters contacts;
  const auto coupling =
      lower_stiffness(ControllerKind::kFourChannel, late, kPeriod, gains, contacts);
  REQUIRE(coupling);
  CAPTURE(*coupling);
  CHECK_THAT(*coupling,
             ContainsSubstring("too stiff for this device, whose force comes 20.5 ms after") &&
                 ContainsSubstring("a coupling of 1500 N/m and 30 N·s/m, ") &&
                 ContainsSubstring("a coupling of 1 N·m/rad and 0.03 N·m·s/rad, ") &&
                 ContainsSubstring("--keep-stiffness"));
  CHECK(gains.stiffness < 300);
  CHECK(gains.damping == Approx(0.02 * gains.stiffness));
  CHECK(gains.angular_damping == Approx(0.03 * gains.angular_stiffness));
  CHECK(contacts.max_hand_stiffness == Range::kInfinite);

  contacts.damping = 0;
  const auto walls = lower_stiffness(ControllerKind::kDirect, late, kPeriod, gains, contacts);
  REQUIRE(walls);
  CAPTURE(*walls);
  CHECK(contacts.max_hand_stiffness == Approx(0.5 * 5 / 0.0205).epsilon(0.05));  // of b / lag, N/m
  // Of the damping that the rated 10 N·m/rad need at 1 kHz.
  CHECK(contacts.max_hand_angular_stiffness == Approx(0.5 * 5e-3 / 0.0205).epsilon(0.15));
  CHECK_THAT(*walls, ContainsSubstring("contacts of 16000 N/m together") &&
                         ContainsSubstring("contacts on a lever"));

  DeviceRatings slow = rated(late_by(0));
  slow.velocity_lag = 10e-3;
  gains = {};
  const auto lag = lower_stiffness(ControllerKind::kFourChannel, slow, kPeriod, gains, contacts);
  REQUIRE(lag);
  CHECK_THAT(*lag, ContainsSubstring("0.5 ms after its motion, its velocity 10 ms later"));
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
