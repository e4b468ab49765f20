// What the fake of Force Dimension's library simulates: models, the handle in a hand, the clock.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <deque>
#include <mutex>
#include <numbers>
#include <vector>

#include "body.h"
#include "force_dimension_doubts.h"

namespace {  // Each fake is one source: two of them in a process share nothing.

// Values of the header (dhdc37; 22 from core).
enum Error {
  kNoError = 0,
  kErrorCom = 2,
  kErrorNoDevice = 5,
  kErrorNotAvailable = 6,
  kErrorTimeout = 7,
  kErrorExpert = 9,
  kErrorNotReady = 12,
  kErrorIndex = 15,
  kErrorNull = 17,
  kErrorNotEnabled = 19,
  kErrorInvalid = 21,
  kErrorNoRegulation = 22
};
constexpr int kTimeGuard = 1;
constexpr int kMotorSaturated = 2;
enum Cause { kCauseNone, kCauseButton, kCauseVelocity, kCauseWatchdog, kCauseSoftware };

constexpr double kLongestCatchUp = 1.0;  // s; a process that slept longer finds the handle at rest.
constexpr double kWatchdogUnit = 125e-6;  // s; core, setWatchdog.
constexpr double kExchange = 60e-6;       // s; assumed: 4 kHz (product pages) of some four calls.
constexpr double kMicroframe = 125e-6;    // s; of USB 2.0.
constexpr double kBrakeDamping = 20.0;    // N·s/m; assumed: motors in short circuit.
constexpr double kOwnDamping = 0.5;       // N·s/m; assumed: friction of the arms.
constexpr double kSpeedLimit = 2.5;       // m/s; assumed: where the controller brakes by itself.
constexpr double kWristInertia = 2e-4;    // kg·m²; assumed.
constexpr double kGripperLever = 0.06;    // m; assumed: from the gripper's axis to the finger.
constexpr double kGripperInertia = 5e-5;  // kg·m²; assumed.
constexpr double kButtonOpening = 0.06;   // rad; an emulated button is down below this opening.
constexpr double kUncalibratedOffset = 0.02;  // m; error of positions before calibration.
constexpr double kInitSeconds = 0.05;         // s; automatic calibration; real ones take seconds.

struct Model {
  const char* name;
  int type;              // dhdc37; lambda.7 from core.
  bool wrist;            // core, table of device types; delta.6 from chai3d.
  bool torque;           // Nm motors in the wrist.
  double mass;           // kg; assumed.
  double force;          // N; chai3d, which calls it the largest continuous force.
  double moment;         // N·m; chai3d.
  double gripper_range;  // rad; chai3d (30°); 0 without a gripper.
  double gripper_force;  // N; chai3d.
  double encoder;        // m; assumed.
  bool left;
};

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::array<Model, 13> kModels{{
    {"delta.3", 63, false, false, 0.30, 20.0, 0.0, 0.0, 0.0, 2e-5, false},
    {"delta.6", 64, true, true, 0.45, 20.0, 0.2, 0.0, 0.0, 2e-5, false},
    {"omega.3", 33, false, false, 0.20, 12.0, 0.0, 0.0, 0.0, 1e-5, false},
    {"omega.6", 34, true, false, 0.25, 12.0, 0.0, 0.0, 0.0, 1e-5, false},
    {"omega.6-left", 36, true, false, 0.25, 12.0, 0.0, 0.0, 0.0, 1e-5, true},
    {"omega.7", 35, true, false, 0.30, 12.0, 0.0, 30 * kDegree, 8.0, 1e-5, false},
    {"omega.7-left", 37, true, false, 0.30, 12.0, 0.0, 30 * kDegree, 8.0, 1e-5, true},
    {"sigma.7", 104, true, true, 0.40, 12.0, 0.2, 30 * kDegree, 8.0, 2e-6, false},
    {"sigma.7-left", 105, true, true, 0.40, 12.0, 0.2, 30 * kDegree, 8.0, 2e-6, true},
    {"lambda.7", 108, true, true, 0.50, 12.0, 0.2, 15 * kDegree, 4.0, 2e-6, false},
    {"lambda.7-left", 109, true, true, 0.50, 12.0, 0.2, 15 * kDegree, 4.0, 2e-6, true},
    {"Falcon", 60, false, false, 0.12, 8.0, 0.0, 0.0, 0.0, 5e-5, false},
    {"lambda.3", 203, false, false, 0.45, 12.0, 0.0, 0.0, 0.0, 2e-6, false},
}};

// A sample of what the controller measured, with the machine's time (s).
struct Sample {
  double time = 0;
  Vec value{};
};

// The vendor's estimate of speed: difference over a window of time.
struct Estimator {
  std::deque<Sample> samples;
  double window = 0.020;  // s; 20 ms is the header's default.

  void update(double time, const Vec& value) {
    if (!samples.empty() && samples.back().time == time) return;
    samples.push_back({time, value});
  }
  bool speed(double now, Vec* out) {
    while (!samples.empty() && samples.front().time < now - window) samples.pop_front();
    if (samples.size() < 2) return false;
    const double dt = samples.back().time - samples.front().time;
    *out = (1.0 / dt) * (samples.back().value - samples.front().value);
    return true;
  }
};

enum class Mode { kReset, kIdle, kForce, kBrake };

struct Device {
  bool open = false, by_drd = false, plugged = true, calibrated = true;
  bool gravity = true, emulate = false, regulating = false;
  Mode mode = Mode::kBrake;
  int cause = kCauseSoftware;
  unsigned buttons = 0;
  Body handle, wrist, gripper;  // The gripper's opening is its x.
  Vec force{}, torque{};
  double gripper_force = 0, max_force = -1, max_torque = -1, max_gripper = -1;
  double effector_mass = 0;
  Estimator linear, angular, gripper_speed;
  int watchdog = 0;       // Units.
  double time_guard = 0;  // s
  unsigned velocity_threshold = 100;
  double fed = 0, last_read = -1e9;
  Vec seen_position{}, seen_rotation{};
  double seen_gripper = 0;
  double rate_since = 0, rate = 0;  // s, kHz
  int rate_count = 0;
};

std::recursive_mutex g_mutex;
Readings<kDoubts> g_readings(kSentences);
Model g_model = kModels[2];
std::vector<Device> g_devices;
int g_default = -1;
bool g_expert = false, g_virtual = false;
double g_time = 0, g_simulated = 0;
thread_local int t_error = kNoError;

bool second(Doubt d) { return g_readings.second(d); }

int fail(int error) {
  t_error = error;
  return -1;
}
int good(int value = 0) {
  if (second(kLastError)) t_error = kNoError;
  return value;
}

double now() {
  if (g_virtual) return g_time;
  const auto t = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(t).count();
}

// ---------------------------------------------------------------- the simulated device

void forces_off(Device& d, int cause, Mode mode) {
  if (d.mode == Mode::kForce) d.cause = cause;
  d.mode = d.calibrated ? mode : Mode::kReset;
  d.force = d.torque = {};
  d.gripper_force = 0;
}

void step(Device& d, double time) {
  if (d.mode == Mode::kForce && d.watchdog > 0 && time - d.fed > d.watchdog * kWatchdogUnit)
    forces_off(d, kCauseWatchdog, Mode::kBrake);
  const bool on = d.mode == Mode::kForce;
  const double friction = kOwnDamping + (d.mode == Mode::kBrake ? kBrakeDamping : 0.0);
  d.handle.step(on ? d.force : Vec{}, g_model.mass, friction);
  d.wrist.step(on && g_model.torque ? d.torque : Vec{}, kWristInertia, 1e-4);
  d.gripper.step({on ? d.gripper_force * kGripperLever : 0, 0, 0}, kGripperInertia, 1e-3);
  const double opening = std::clamp(d.gripper.position[0], 0.0, g_model.gripper_range);
  if (opening != d.gripper.position[0]) d.gripper.velocity[0] = 0;
  d.gripper.position[0] = opening;
  if (on && norm(d.handle.velocity) > kSpeedLimit && d.velocity_threshold > 0)
    forces_off(d, kCauseVelocity, Mode::kBrake);
}

void catch_up() {
  const double time = now();
  if (time - g_simulated > kLongestCatchUp) g_simulated = time - kLongestCatchUp;
  for (; g_simulated + kStep <= time; g_simulated += kStep)
    for (Device& d : g_devices) step(d, g_simulated);
}

// Reads the encoders, unless the time guard finds the last data recent enough.
int communicate(Device& d) {
  catch_up();
  double time = now();
  if (d.time_guard > 0 && time - d.last_read < d.time_guard) return kTimeGuard;
  if (second(kExchanges) && time - d.last_read < kMicroframe) return 0;
  if (!g_virtual)
    for (const double start = time; time < start + kExchange;) time = now();
  if (!second(kWatchdogFeed)) d.fed = time;
  d.last_read = time;
  for (std::size_t i = 0; i < 3; ++i) {
    const double offset = d.calibrated ? 0.0 : kUncalibratedOffset;
    d.seen_position[i] = rounded(d.handle.position[i] + offset, g_model.encoder);
    d.seen_rotation[i] = rounded(d.wrist.position[i], 2e-4);
  }
  d.seen_gripper = rounded(d.gripper.position[0], 1e-4);
  return 0;
}

enum Read { kReadPosition, kReadOther, kReadLinear, kReadAngular, kReadGripper };

// Which estimators a successful reading feeds is one of the doubts.
void feed_estimators(Device& d, Read read) {
  const bool any = !second(kVelocityUpdates);
  const double time = d.last_read;
  if (any || read == kReadPosition || read == kReadLinear) d.linear.update(time, d.seen_position);
  if (any || read == kReadPosition || read == kReadAngular) d.angular.update(time, d.seen_rotation);
  if (any || read == kReadGripper) d.gripper_speed.update(time, {d.seen_gripper, 0, 0});
}

double side() { return g_model.left ? -1.0 : 1.0; }

void matrix_of(const Vec& r, double m[3][3]) {
  const double angle = norm(r), s = angle > 0 ? std::sin(angle) / angle : 1.0;
  const double c = angle > 0 ? (1 - std::cos(angle)) / (angle * angle) : 0.5;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      m[i][j] = c * r[i] * r[j] + (i == j ? 1 - c * angle * angle : 0.0);
  m[0][1] -= s * r[2], m[1][0] += s * r[2];
  m[0][2] += s * r[1], m[2][0] -= s * r[1];
  m[1][2] -= s * r[0], m[2][1] += s * r[0];
}

void frame_of(const Device& d, double m[3][3]) {
  matrix_of(d.seen_rotation, m);
  if ((g_model.type != 34 && g_model.type != 36) || !second(kOmega6Frame)) return;
  double turn[3][3], body[3][3];
  matrix_of({0, std::numbers::pi / 4, 0}, turn);
  std::memcpy(body, m, sizeof(body));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      m[i][j] = turn[i][0] * body[0][j] + turn[i][1] * body[1][j] + turn[i][2] * body[2][j];
}

}  // namespace
