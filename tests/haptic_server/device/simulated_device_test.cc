#include "hlm/haptic_server/device/simulated_device.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;  // s.

/// Only inertia: what a test is about, it adds.
SimulatedDeviceOptions frictionless() {
  SimulatedDeviceOptions options;
  options.freedom = DeviceFreedom::kSpatial;
  options.damping = 0;
  options.angular_damping = 0;
  options.dry_friction = 0;
  return options;
}

Wrench wrench(const Vector3& force, const Vector3& torque = Vector3::Zero()) {
  Wrench F;
  F << force, torque;
  return F;
}

HandScript pushing(const Push& push, double duration = 1000) {
  return {{{duration, push}}, AfterLastSegment::kHold};
}
HandScript pushing(const Vector3& force, const Vector3& torque = Vector3::Zero()) {
  return pushing(Push{.constant = wrench(force, torque)});
}

SimulatedDevice started(const SimulatedDeviceOptions& options, HandScript hand = {},
                        const Pose& X_WH = {}, double dt = kDt) {
  REQUIRE_FALSE(find_error(options));
  SimulatedDevice device(options, std::move(hand), dt);
  device.align(X_WH);
  device.enable();
  return device;
}

DeviceState run(SimulatedDevice& device, int ticks, const Wrench& F = Wrench::Zero()) {
  bool accepted = true;
  for (int i = 0; i < ticks; ++i) accepted = device.write(F) && accepted;
  REQUIRE(accepted);
  return *device.read();
}

TEST_CASE("A free device under a constant motor force moves by half F/m t² within 1e-12 m") {
  SimulatedDevice device = started(frictionless());
  const DeviceState state = run(device, 1000, wrench({2, 0, -1}));
  CHECK((state.X_WD.p - Vector3(1, 0, -0.5)).norm() < 1e-12);
  CHECK((state.V_WD.head<3>() - Vector3(2, 0, -1)).norm() < 1e-12);
}

TEST_CASE("A free device under a constant torque turns by half T/I t² within 1e-9 rad") {
  SimulatedDevice device = started(frictionless());
  const DeviceState state = run(device, 1000, wrench({0, 0, 0}, {0.003, 0, 0}));
  CHECK((rotation_vector(state.X_WD.R) - Vector3(0.75, 0, 0)).norm() < 1e-9);
  CHECK(std::abs(state.X_WD.R.norm() - 1) < 1e-12);
}

TEST_CASE("A push ends at the terminal velocity F/b, on the way of an exponential") {
  SimulatedDeviceOptions options = frictionless();
  options.damping = 5;
  SimulatedDevice device = started(options, pushing({1, 0, 0}));
  const double rise = 0.2;  // m/b, s.
  CHECK(std::abs(run(device, 200).V_WD[0] - 0.2 * (1 - std::exp(-0.2 / rise))) < 1e-9);
  CHECK(std::abs(run(device, 6000).V_WD[0] - 0.2) < 1e-9);
}

TEST_CASE("A free device under a sinusoidal push oscillates as the closed form, within 1e-6 m") {
  const Push push{.amplitude = wrench({1, 0, 0}), .frequency = 2.5};
  SimulatedDevice device = started(frictionless(), pushing(push));
  const double omega = 2 * std::numbers::pi * push.frequency;
  for (int i = 1; i <= 1000; ++i) {
    const double t = i * kDt;
    const double x = (t - std::sin(omega * t) / omega) / omega;
    REQUIRE(std::abs(run(device, 1).X_WD.p.x() - x) < 1e-6);
  }
}

TEST_CASE("Dry friction of 0.2 N holds 0.19 N without any motion and yields to 0.21 N") {
  SimulatedDeviceOptions options = frictionless();
  options.dry_friction = 0.2;
  const double angle = GENERATE(0.0, 1.0, 4.0);
  const Vector3 direction(std::cos(angle), std::sin(angle), 0);

  SimulatedDevice held = started(options, pushing(0.19 * direction));
  CHECK(run(held, 1000).X_WD.p == Vector3::Zero());
  SimulatedDevice yielding = started(options, pushing(0.21 * direction));
  CHECK((run(yielding, 1000).X_WD.p - 0.005 * direction).norm() < 1e-9);
}

TEST_CASE("Dry friction torque holds less than itself") {
  SimulatedDeviceOptions options = frictionless();
  options.dry_friction_torque = 0.01;
  SimulatedDevice held = started(options, pushing({0, 0, 0}, {0, 0, 0.0099}));
  CHECK(rotation_vector(run(held, 1000).X_WD.R).norm() == 0);
  SimulatedDevice yielding = started(options, pushing({0, 0, 0}, {0, 0, 0.0101}));
  CHECK(rotation_vector(run(yielding, 1000).X_WD.R).z() > 0.01);
}

TEST_CASE("Dry friction brings a sliding device to rest after half m v²/F, and never back") {
  SimulatedDeviceOptions options = frictionless();
  options.dry_friction = 0.2;
  SimulatedDevice device = started(options);
  double before = run(device, 10, wrench({10.2, 0, 0})).X_WD.p.x();
  const double thrown = before + 0.5 * 0.1 * 0.1 / 0.2;  // 0.1 m/s, 0.2 m/s².
  for (int i = 0; i < 1000; ++i) {
    const double x = run(device, 1).X_WD.p.x();
    REQUIRE(x >= before);
    before = x;
  }
  CHECK(std::abs(before - thrown) < 2e-6);
  CHECK(device.read()->V_WD == Twist::Zero());
}

TEST_CASE("The motors saturate in the command's direction") {
  SimulatedDevice device = started(frictionless());
  const DeviceState state = run(device, 100, wrench({30, 40, 0}, {0, 0, -6}));
  CHECK((state.V_WD.head<3>() - 0.1 * Vector3(7.2, 9.6, 0)).norm() < 1e-12);
  CHECK(std::abs(state.V_WD[5] + 0.1 * 0.6 / 2e-3) < 1e-9);
}

TEST_CASE("A delay of n ticks is exactly n ticks") {
  SimulatedDeviceOptions options = frictionless();
  options.delay = GENERATE(0, 1, 3, kMaxDelay);
  SimulatedDevice device = started(options);
  const DeviceState before =
      options.delay == 0 ? *device.read() : run(device, options.delay, wrench({1, 0, 0}));
  CHECK(before.X_WD.p.x() == 0);
  CHECK(run(device, 1, wrench({1, 0, 0})).X_WD.p.x() > 0);

  // And a single command acts for one tick alone.
  SimulatedDevice tapped = started(options);
  run(tapped, 1, wrench({1, 0, 0}));
  CHECK(std::abs(run(tapped, 2 * kMaxDelay).V_WD[0] - kDt) < 1e-15);
}

TEST_CASE("Enabling forgets commands that were under way") {
  SimulatedDeviceOptions options = frictionless();
  options.delay = 3;
  SimulatedDevice device = started(options);
  run(device, 3, wrench({5, 0, 0}));
  device.disable();
  device.enable();
  CHECK(run(device, 10).V_WD == Twist::Zero());
}

TEST_CASE("Reported poses lie on the encoders' grid, less than a step from the truth") {
  SimulatedDeviceOptions exact = frictionless();
  SimulatedDeviceOptions coarse = exact;
  coarse.position_step = 1e-4;
  coarse.angle_step = 1e-3;
  test::Random random;
  const Pose X_WH = random.pose(0.1);
  const Wrench F = wrench({0.3, -0.2, 0.1}, {1e-3, 2e-3, -1e-3});
  SimulatedDevice reference = started(exact, {}, X_WH);
  SimulatedDevice device = started(coarse, {}, X_WH);
  CHECK(device.read()->X_WD == X_WH);
  for (int i = 0; i < 500; ++i) {
    const Pose truth = run(reference, 1, F).X_WD;
    const Pose X_WD = run(device, 1, F).X_WD;
    const Vector6 e = displacement(X_WH, X_WD);
    for (int k = 0; k < 6; ++k) {
      const double steps = e[k] / (k < 3 ? 1e-4 : 1e-3);
      REQUIRE(std::abs(steps - std::round(steps)) < 1e-6);
    }
    REQUIRE((X_WD.p - truth.p).cwiseAbs().maxCoeff() <= 0.5001e-4);
    REQUIRE((e - displacement(X_WH, truth)).tail<3>().cwiseAbs().maxCoeff() <= 0.5001e-3);
  }
}

TEST_CASE("A quantised velocity is the step over the period, or zero") {
  SimulatedDeviceOptions options = frictionless();
  options.position_step = 1e-4;
  SimulatedDevice device = started(options, pushing({0.1, 0, 0}));
  for (int i = 0; i < 500; ++i) {
    const double steps = run(device, 1).V_WD[0] * kDt / 1e-4;
    REQUIRE(std::abs(steps - std::round(steps)) < 1e-9);
  }
}

TEST_CASE("The velocity filter lags a ramp by its time constant") {
  SimulatedDeviceOptions options = frictionless();
  options.velocity_cutoff = 20;  // Hz.
  SimulatedDevice device = started(options, pushing({2, 0, 0}));
  const double lag = 1 / (2 * std::numbers::pi * 20);  // s.
  const double v = run(device, 500).V_WD[0];
  CHECK(std::abs(v - 2 * (0.5 - lag)) < 2 * 1.0 * kDt);
  CHECK(v < 2 * 0.5 - 0.9 * 2 * lag);
}

TEST_CASE("The sensed velocity follows a turn through half a revolution") {
  SimulatedDeviceOptions options = frictionless();
  options.angle_step = 1e-6;
  SimulatedDevice device = started(options, pushing({0, 0, 0}, {0, 0, 0.02}));
  for (int i = 1; i <= 1000; ++i) {
    REQUIRE(std::abs(run(device, 1).V_WD[5] - 10 * kDt * (i - 0.5)) < 2e-3);
  }
}

TEST_CASE("A planar device moves in its plane only, and feels the hand there only") {
  SimulatedDeviceOptions options = frictionless();
  options.freedom = DeviceFreedom::kPlanar;
  const Pose X_WH{Vector3(0.1, 0.2, 0.3), rotation_from_vector(Vector3(0.1, 0, 0))};
  SimulatedDevice device = started(options, pushing({1, 1, 1}, {1e-3, 1e-3, 1e-3}), X_WH);
  CHECK(*device.read()->F_hand == wrench({1, 1, 0}, {0, 0, 1e-3}));
  const DeviceState state = run(device, 100, wrench({0, 0, 5}, {0.1, 0.1, 0}));
  CHECK(state.X_WD.p.z() == 0.3);
  CHECK(state.X_WD.p.x() > 0.1);
  const Vector6 e = displacement(X_WH, state.X_WD);
  CHECK(e.segment<2>(3).norm() < 1e-12);
  CHECK(std::abs(e[5] - 0.5 * 0.5 * 0.01) < 1e-9);
}

TEST_CASE("Without motors or hand the kinetic energy only falls") {
  SimulatedDeviceOptions options;
  options.freedom = DeviceFreedom::kSpatial;
  options.dry_friction_torque = 1e-3;
  const double dt = GENERATE(1.0 / 100, 1.0 / 512, 1.0 / 8000);
  SimulatedDevice device = started(options, {}, {}, dt);
  for (int i = 0; i < 10; ++i) run(device, 1, wrench({12, -3, 5}, {0.1, 0.3, -0.2}));
  const auto energy = [&](const Twist& V) {
    return 0.5 *
           (options.mass * V.head<3>().squaredNorm() + options.inertia * V.tail<3>().squaredNorm());
  };
  double before = energy(device.read()->V_WD);
  CHECK(before > 0);
  for (int i = 0; i < static_cast<int>(2 / dt); ++i) {
    const double now = energy(run(device, 1).V_WD);
    REQUIRE((now < before || now == 0));
    before = now;
  }
  CHECK(before == 0);
}

TEST_CASE("An undamped hand spring neither gains nor loses energy in 20 s") {
  Reach still;
  still.position = Vector3(0.01, 0, 0);
  still.grip.damping = still.grip.angular_damping = 0;
  // The target jumps there at once: a duration far below the period of 0.44 s.
  const HandScript hand{{{1e-3, still}}, AfterLastSegment::kHold};
  SimulatedDevice device = started(frictionless(), hand);
  run(device, 1);
  const auto energy = [](const DeviceState& s) {
    return 0.5 * s.V_WD[0] * s.V_WD[0] + 0.5 * 200 * std::pow(s.X_WD.p.x() - 0.01, 2);
  };
  const double before = energy(*device.read());
  CHECK(std::abs(energy(run(device, 20000)) / before - 1) < 1e-4);
}

TEST_CASE("The stiffest hand on the lightest device stays stable at 100 Hz") {
  SimulatedDeviceOptions options = frictionless();
  options.mass = 0.05;
  options.inertia = 1e-4;
  Reach reach;
  reach.position = Vector3(0.05, 0, 0);
  reach.rotation = Vector3(0, 0, 1);
  reach.grip = {2e4, 500, 100, 1, 1000, 100};
  SimulatedDevice device = started(options, {{{1.0, reach}}, AfterLastSegment::kHold}, {}, 0.01);
  const DeviceState state = run(device, 200);
  CHECK((state.X_WD.p - *reach.position).norm() < 1e-6);
  CHECK((rotation_vector(state.X_WD.R) - *reach.rotation).norm() < 1e-6);
}

TEST_CASE("A disabled device ignores wrenches but follows the hand") {
  SimulatedDevice device = started(frictionless(), pushing({1, 0, 0}));
  device.disable();
  const DeviceState state = run(device, 100, wrench({0, 5, 0}));
  CHECK(std::abs(state.V_WD[0] - 0.1) < 1e-12);
  CHECK(state.V_WD[1] == 0);
}

TEST_CASE("Aligning starts the device and its hand anew, at rest") {
  SimulatedDevice device =
      started(frictionless(), pushing(Push{.amplitude = wrench({1, 0, 0}), .frequency = 1}));
  const DeviceState first = run(device, 100);
  const Pose X_WH{Vector3(0.3, 0, 0), Quaternion::Identity()};
  device.align(X_WH);
  CHECK(device.read()->X_WD == X_WH);
  CHECK(device.read()->V_WD == Twist::Zero());
  const DeviceState second = run(device, 100);
  CHECK(second.V_WD == first.V_WD);
  CHECK(second.F_hand == first.F_hand);
}

TEST_CASE("The measured hand wrench is that of the present instant") {
  const Push push{.amplitude = wrench({1, 0, 0}, {0, 0, 0.1}), .frequency = 2.5, .phase = 0.3};
  SimulatedDevice device = started(frictionless(), pushing(push));
  for (int i = 0; i < 1000; ++i) {
    const double sine = std::sin(2 * std::numbers::pi * 2.5 * i * kDt + 0.3);
    REQUIRE((*device.read()->F_hand - push.amplitude * sine).norm() < 1e-12);
    run(device, 1);
  }
}

TEST_CASE("Without a sensor the hand still acts, unseen") {
  SimulatedDeviceOptions options = frictionless();
  options.measures_hand_wrench = false;
  SimulatedDevice device = started(options, pushing({1, 0, 0}));
  CHECK_FALSE(device.measures_hand_wrench());
  const DeviceState state = run(device, 100);
  CHECK_FALSE(state.F_hand);
  CHECK(state.V_WD[0] > 0.09);
}

TEST_CASE("Reading changes nothing") {
  SimulatedDeviceOptions options;
  options.position_step = 1e-5;
  const HandScript hand{{{0.0333, Push{.constant = wrench({1, 0, 0})}}, {0.1, Reach{}}},
                        AfterLastSegment::kRepeat};
  SimulatedDevice read_often = started(options, hand);
  SimulatedDevice read_once = started(options, hand);
  for (int i = 0; i < 500; ++i) {
    read_often.read();
    read_often.read();
    run(read_often, 1);
    read_once.write(Wrench::Zero());
  }
  CHECK(read_often.read()->X_WD == read_once.read()->X_WD);
  CHECK(read_often.read()->V_WD == read_once.read()->V_WD);
}

TEST_CASE("Nothing allocates once the device is built") {
  SimulatedDeviceOptions options;
  options.position_step = 1e-5;
  options.delay = 2;
  const HandScript hand{{{0.05, Push{.constant = wrench({1, 0, 0})}}, {0.05, Reach{}}},
                        AfterLastSegment::kRepeat};
  SimulatedDevice device(options, hand, kDt);
  std::size_t allocations = 0;
  {
    const test::NoMalloc guard;
    device.align(Pose{});
    device.enable();
    for (int i = 0; i < 300; ++i) device.write(device.read()->F_hand.value());
    device.disable();
    allocations = guard.allocations();
  }
  CHECK(allocations == 0);
}

TEST_CASE("A command that is not finite is refused and moves nothing") {
  SimulatedDevice device = started(frictionless(), pushing({1, 0, 0}));
  CHECK_FALSE(device.write(Wrench::Constant(std::numeric_limits<double>::quiet_NaN())));
  CHECK_FALSE(device.write(Wrench::Constant(std::numeric_limits<double>::infinity())));
  CHECK(device.read()->V_WD == Twist::Zero());
}

TEST_CASE("The ratings are the options'") {
  SimulatedDeviceOptions options;
  options.max_force = 7;
  options.max_torque_rate = 55;
  const SimulatedDevice device(options, {}, kDt);
  CHECK(device.ratings().max_force == 7);
  CHECK(device.ratings().max_torque == 0.6);
  CHECK(device.ratings().max_torque_rate == 55);
  CHECK(device.ratings().mass == 1);
  CHECK(device.ratings().inertia == 2e-3);
  CHECK(device.ratings().damping == 5);
}

TEST_CASE("Options out of range are refused with name, value and range") {
  CHECK_FALSE(find_error(SimulatedDeviceOptions{}));
  SimulatedDeviceOptions options;
  SECTION("mass") {
    options.mass = 0.01;
    CHECK(*find_error(options) == "mass 0.01 kg must be 0.05 to 1000 kg");
  }
  SECTION("not a number") {
    options.damping = std::numeric_limits<double>::quiet_NaN();
    CHECK(*find_error(options) == "damping nan N·s/m must be 0 to 10000 N·s/m");
  }
  SECTION("force") {
    options.max_force = 0;
    CHECK(*find_error(options) == "max force 0 N must be at least 0.01 N");
  }
  SECTION("delay") {
    options.delay = -1;
    CHECK(*find_error(options) == "delay -1 ticks must be 0 to 64 ticks");
  }
}

TEST_CASE("A command above what the motors give is reported as saturation, until it is over") {
  SimulatedDeviceOptions options = frictionless();
  options.max_torque = 0.1;  // N·m.
  SimulatedDevice device = started(options);
  CHECK(device.read()->health == DeviceHealth::kGood);
  Wrench F = Wrench::Zero();
  F[5] = 0.11;
  run(device, 1, F);
  CHECK(device.read()->health == DeviceHealth::kSaturated);
  F[5] = 0.1;
  run(device, 1, F);
  CHECK(device.read()->health == DeviceHealth::kGood);
}

TEST_CASE("A person far away can hold its hand, and let go") {
  SimulatedDevice device = started(frictionless(), pushing({1, 0, 0}));
  GuidedHand* const hand = device.guided_hand();
  REQUIRE(hand != nullptr);
  hand->hold({{0.02, 0, 0}, Quaternion::Identity()});
  CHECK(run(device, 2000).X_WD.p.x() == Approx(0.02).margin(1e-3));  // m
  hand->release();
  CHECK(run(device, 200).X_WD.p.x() > 0.03);  // The script's hand pushes again.
}

}  // namespace
}  // namespace hlm::server
