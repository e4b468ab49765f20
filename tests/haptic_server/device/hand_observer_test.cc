// The observer of the hand's wrench, on the simulated device with its own hand.
#include "hlm/haptic_server/device/hand_observer.h"

#include <cmath>
#include <complex>
#include <numbers>

#include "hlm/haptic_server/device/observed_device.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::server {
namespace {

constexpr double kBandwidth = 50;  // Hz

/// Without what counts as the hand's: dry friction, and damping in rotation.
SimulatedDeviceOptions frictionless() {
  SimulatedDeviceOptions options;
  options.dry_friction = 0;
  options.angular_damping = 0;
  options.measures_hand_wrench = false;
  return options;
}

HandScript shaken(double frequency) {
  Push push;
  push.amplitude << 2, 0, 0, 0, 0, 0.02;  // N, N·m
  push.frequency = frequency;
  return {{{1.0, push}}, AfterLastSegment::kHold};
}

struct Course {
  SimulatedDeviceOptions device = frictionless();
  ObserverOptions observer{.bandwidth = kBandwidth};
  double hand = 2.5;    ///< Hz.
  double motors = 0;    ///< Amplitude of their force at 12 Hz, N.
  double rate = 1000;   ///< Hz.
  double duration = 4;  ///< s.
};

/// visit(t, what the observer says) at each tick of the second half.
template <class Visit>
void play(const Course& course, const Visit& visit) {
  const double dt = 1 / course.rate;
  const auto device =
      with_hand_observer(std::make_unique<SimulatedDevice>(course.device, shaken(course.hand), dt),
                         course.observer, dt);
  device->align({});
  device->enable();
  const auto steps = static_cast<int>(course.duration * course.rate);
  for (int step = 0; step < steps; ++step) {
    const double t = step * dt;
    const std::optional<DeviceState> state = device->read();
    if (2 * step >= steps) visit(t, *state->F_hand);
    Wrench u = Wrench::Zero();
    u[0] = course.motors * std::sin(2 * std::numbers::pi * 12 * t);
    device->write(u);
  }
}

/// Of the estimate by the hand's own wrench, at the hand's frequency.
std::complex<double> response(const Course& course, Eigen::Index component, double amplitude) {
  const double w = 2 * std::numbers::pi * course.hand;
  std::complex<double> sum = 0;
  int count = 0;
  play(course, [&](double t, const Wrench& F) {
    sum += F[component] * std::polar(1.0, -w * t);
    ++count;
  });
  return 2.0 * sum / static_cast<double>(count) * std::complex<double>(0, 1) / amplitude;
}

/// Largest error of the estimated force, N, beside its lag: against the same without motors.
double effect_of_motors(Course course) {
  std::vector<double> quiet;
  course.motors = 0;
  play(course, [&](double, const Wrench& F) { quiet.push_back(F[0]); });
  course.motors = 5;
  double most = 0;
  std::size_t i = 0;
  play(course,
       [&](double, const Wrench& F) { most = std::max(most, std::abs(F[0] - quiet[i++])); });
  return most;
}

TEST_CASE("The estimate is the hand's wrench through a Butterworth low-pass of third order") {
  const double rate = GENERATE(1000, 4000);  // Hz
  Course course{.rate = rate};
  for (const auto& [component, amplitude] : {std::pair{0, 2.0}, std::pair{5, 0.02}}) {
    CAPTURE(rate, component);
    course.hand = 2.5;
    const std::complex<double> slow = response(course, component, amplitude);
    CHECK(std::abs(slow) == Approx(1).margin(0.01));
    CHECK(std::arg(slow) == Approx(-2 * course.hand / kBandwidth).margin(0.02));  // rad
    course.hand = kBandwidth;
    CHECK(std::abs(response(course, component, amplitude)) == Approx(std::sqrt(0.5)).margin(0.05));
    course.hand = 4 * kBandwidth;
    CHECK(std::abs(response(course, component, amplitude)) < 0.03);
  }
}

TEST_CASE("What the motors give is not taken for the hand's, late by some ticks or not") {
  Course course;
  course.device.delay = GENERATE(0, 1, 3, 20);
  CAPTURE(course.device.delay);
  CHECK(effect_of_motors(course) < 0.02);  // N, of 5
}

TEST_CASE("The longest delay, of 0.1 s, is taken into account at every rate of the servo") {
  const double rate = GENERATE(1000.0, 4000.0, 8000.0);  // Hz
  DeviceRatings rated;
  rated.mass = 1;     // kg
  rated.delay = 0.1;  // s
  HandObserver observer(rated, kBandwidth, 1 / rate);
  Pose X;
  observer.restart(X);
  // A handle that nobody holds rests, and so does the estimate until a command reaches it.
  const auto due = static_cast<int>(0.1 * rate);
  Wrench push = Wrench::Zero();
  push[0] = 1;  // N
  for (int step = 0; step < due; ++step) {
    observer.command(push);
    CHECK(observer.observe(X, true).norm() == 0);
  }
  // Then it moves as the command drives it.
  double v = 0;
  double most = 0;
  for (int step = 0; step < due; ++step) {
    observer.command(push);
    X.p.x() += v / rate + 0.5 / (rate * rate);
    v += 1 / rate;
    most = std::max(most, observer.observe(X, true).norm());
  }
  CAPTURE(rate);
  CHECK(most < 1e-6);  // N
}

TEST_CASE("A delay that is not known, or a wrong mass, is taken for the hand's") {
  const double dt = 1e-3;
  const Wrench u = Wrench::Constant(1);
  SimulatedDeviceOptions late = frictionless();
  late.delay = 3;
  SimulatedDevice device(late, {}, dt);
  DeviceRatings rated = device.ratings();
  rated.delay = 0;
  HandObserver observer(rated, kBandwidth, dt);
  device.align({});
  device.enable();
  double least = 0;
  for (int step = 0; step < 50; ++step) {
    least = std::min(least, observer.observe(device.read()->X_WD, true)[0]);
    observer.command(u);
    device.write(u);
  }
  CHECK(least < -0.3);  // N: it seems to be held against the motors

  Course heavy;
  heavy.observer.mass = 1.5;
  CHECK(effect_of_motors(heavy) > 1);  // N
}

TEST_CASE("Encoder steps of 0.05 mm make noise of 0.5 N at most, at 1 and at 4 kHz") {
  Course course{.rate = GENERATE(1000.0, 4000.0)};
  std::vector<double> exact;
  play(course, [&](double, const Wrench& F) { exact.push_back(F[0]); });
  course.device.position_step = 5e-5;
  double squares = 0;
  std::size_t i = 0;
  play(course, [&](double, const Wrench& F) { squares += std::pow(F[0] - exact[i++], 2); });
  const double noise = std::sqrt(squares / static_cast<double>(i));
  CAPTURE(course.rate, noise);
  CHECK(noise < 0.5);    // N, rms
  CHECK(noise > 0.005);  // it is there
}

TEST_CASE("A loop that stands still for some periods finds no blow of the hand") {
  const double dt = 1e-3;
  DeviceRatings rated = SimulatedDevice(frictionless(), {}, dt).ratings();
  HandObserver observer(rated, kBandwidth, dt);
  Pose X_WD;
  double most = 0;
  for (int step = 0; step < 200; ++step) {
    X_WD.p.x() += step == 100 ? 0.01 : 0.5 * dt;  // 0.5 m/s; 20 periods missed
    most = std::max(most, observer.observe(X_WD, true).head<3>().norm());
  }
  CHECK(most <= rated.max_force);  // N
}

TEST_CASE("Where the handle cannot move there is no hand") {
  const double dt = 1e-3;
  const auto device = with_hand_observer(
      std::make_unique<SimulatedDevice>(frictionless(), shaken(2.5), dt), {}, dt);
  device->align({});
  device->enable();
  double across = 0;
  double along = 0;
  for (int step = 0; step < 300; ++step) {
    const Wrench F = *device->read()->F_hand;
    across = std::max({across, std::abs(F[2]), std::abs(F[3]), std::abs(F[4])});
    along = std::max(along, std::abs(F[0]));
    device->write(Wrench::Constant(0.5));
  }
  CHECK(across == 0);
  CHECK(along > 1);  // N
}

TEST_CASE("While the motors are held off commands count for nothing") {
  Course course;
  course.device.switched_on = false;
  CHECK(effect_of_motors(course) < 1e-9);  // N
}

TEST_CASE("A session begins with nobody at the handle, whatever was before") {
  const double dt = 1e-3;
  const auto device = with_hand_observer(
      std::make_unique<SimulatedDevice>(frictionless(), shaken(2.5), dt), {}, dt);
  device->align({});
  device->enable();
  for (int step = 0; step < 100; ++step) {
    device->read();
    device->write(Wrench::Constant(1));
  }
  Pose elsewhere;
  elsewhere.p.x() = 0.3;
  device->align(elsewhere);
  device->enable();
  CHECK(device->read()->F_hand->norm() < 1e-9);
}

TEST_CASE("A hand is observed where it is not measured, a mass is known and it is asked for") {
  const auto opened = [](bool measures, const ObserverOptions& observer) {
    SimulatedDeviceOptions options = frictionless();
    options.measures_hand_wrench = measures;
    return with_hand_observer(std::make_unique<SimulatedDevice>(options, HandScript{}, 1e-3),
                              observer, 1e-3);
  };
  const auto observed = opened(false, {});
  CHECK(observed->measures_hand_wrench());
  CHECK(observed->observes_hand_wrench());
  CHECK(observed->read()->hand_observed);
  CHECK(opened(false, {.mass = 0.3})->ratings().mass == 0.3);
  const auto measured = opened(true, {});
  CHECK_FALSE(measured->observes_hand_wrench());
  CHECK_FALSE(measured->read()->hand_observed);
  const auto off = opened(false, {.on = false});
  CHECK_FALSE(off->measures_hand_wrench());
  CHECK_FALSE(off->read()->F_hand);
}

TEST_CASE("What a person knows of the handle is rated with an observer and without") {
  const bool measures = GENERATE(false, true);
  const bool on = GENERATE(false, true);
  SimulatedDeviceOptions options = frictionless();
  options.measures_hand_wrench = measures;
  const auto device = with_hand_observer(
      std::make_unique<SimulatedDevice>(options, HandScript{}, 1e-3),
      {.on = on, .mass = 0.3, .inertia = 1e-3, .damping = 2.0, .delay = 0.01}, 1e-3);
  CAPTURE(measures, on);
  CHECK(device->ratings().mass == 0.3);      // kg
  CHECK(device->ratings().inertia == 1e-3);  // kg·m²
  CHECK(device->ratings().damping == 2);     // N·s/m
  CHECK(device->ratings().delay == 0.01);    // s
  CHECK(device->observes_hand_wrench() == (on && !measures));
  CHECK(device->measures_hand_wrench() == (on || measures));
}

TEST_CASE("Observing allocates nothing") {
  const auto device = with_hand_observer(
      std::make_unique<SimulatedDevice>(frictionless(), shaken(2.5), 1e-3), {}, 1e-3);
  device->align({});
  device->enable();
  const test::NoMalloc guard;
  for (int step = 0; step < 100; ++step) {
    device->read();
    device->write(Wrench::Constant(1));
  }
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace hlm::server
