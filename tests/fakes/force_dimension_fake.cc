// A fake of Force Dimension's library, written from texts alone: no driver of this project was
// read.
//
// The sources, by the short names that the table below uses:
// core: Python binding forcedimension_core 1.0.0, docstrings after the vendor's (SDK 3.16), and the
//   repository of its documents (device modes, time guard, glossary; SDK 3.14).
// dhdc32, dhdc37: dhdc.h of SDK 3.2 and of 3.7.0-pre, both in public repositories.
// chai3d: the device class cDeltaDevice of CHAI3D. saw: sawForceDimensionSDK.
// icube: forcedimension_ros2. lambda: user manual of the lambda.7, page 18.
//
// A sentence that can be read in two ways is a doubt with two answers, the likelier one first.
// FAKE_DHD_READING or fake_configure chooses: "name:answer,…". FAKE_DHD_MODEL names the model,
// FAKE_DHD_COUNT says how many there are, FAKE_DHD_CALIBRATED=0 starts without calibration,
// FAKE_DHD_CLOCK=virtual leaves the time to fake_advance.
//
// Assumed without a text: masses, encoder steps, the speed at which the device stops, friction.
// Gravity is left out: the simulated arms weigh nothing.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <thread>

#include "force_dimension_api.h"
#include "force_dimension_device.h"

namespace {

// ---------------------------------------------------------------- ids and preconditions

int id_of(std::size_t index) { return static_cast<int>(index) + (second(kIds) ? 5 : 0); }

Device* any_device(int id) {
  if (id == -1) id = g_default;
  for (std::size_t i = 0; i < g_devices.size(); ++i)
    if (id_of(i) == id) return &g_devices[i];
  return nullptr;
}

// The open device of an id; nullptr and an error otherwise.
Device* use(char id) {
  Device* d = any_device(id);
  if (d == nullptr || !d->open) return fail(kErrorNoDevice), nullptr;
  if (!d->plugged) return fail(kErrorCom), nullptr;
  catch_up();
  return d;
}

Device* use_expert(char id) {
  Device* d = use(id);
  if (d != nullptr && !g_expert) return fail(kErrorExpert), nullptr;
  return d;
}

int open_index(int index, bool drd) {
  if (index < 0 || index >= static_cast<int>(g_devices.size())) return fail(kErrorNoDevice);
  Device& d = g_devices[static_cast<std::size_t>(index)];
  if (!d.plugged) return fail(kErrorNoDevice);
  g_default = id_of(static_cast<std::size_t>(index));
  if (drd) d.by_drd = true;
  if (d.open) return good(g_default);
  catch_up();
  d.open = true;
  d.fed = now();
  d.rate_since = now();
  d.mode = !d.calibrated ? Mode::kReset : second(kOpenForce) ? Mode::kForce : Mode::kBrake;
  d.watchdog = second(kWatchdogDefault) ? 255 : 0;
  d.time_guard = second(kTimeGuardDefault) ? 1e-3 : 0.0;
  d.linear.samples.clear(), d.angular.samples.clear(), d.gripper_speed.samples.clear();
  return good(g_default);
}

int close_device(char id, bool drd) {
  Device* d = any_device(id);
  if (d == nullptr || !d->open) return fail(kErrorNoDevice);
  if (second(kClose) && d->by_drd && !drd) return fail(kErrorInvalid);
  catch_up();
  forces_off(*d, kCauseSoftware, Mode::kBrake);
  d->open = d->by_drd = d->regulating = d->emulate = false;
  return good();
}

// ---------------------------------------------------------------- reading and force

int read_pose(char id, Read read, double* position[3], double* rotation[3], double m[3][3]) {
  Device* d = use(id);
  if (d == nullptr) return -1;
  if (d->mode == Mode::kReset && second(kUncalibrated)) return fail(kErrorNotReady);
  const int result = communicate(*d);
  if (result == 0) feed_estimators(*d, read);
  if (result == kTimeGuard && second(kTimeGuardData)) return good(kTimeGuard);
  for (std::size_t i = 0; i < 3; ++i) {
    if (position != nullptr) *position[i] = d->seen_position[i];
    if (rotation != nullptr) *rotation[i] = d->seen_rotation[i];
  }
  if (m != nullptr) frame_of(*d, m);
  return good(result);
}

int read_speed(char id, Read read, Estimator Device::*estimator, Vec* out) {
  Device* d = use(id);
  if (d == nullptr) return -1;
  if (communicate(*d) == 0) feed_estimators(*d, read);
  *out = {};
  if (!(d->*estimator).speed(now(), out) && !second(kVelocityMissing)) return fail(kErrorTimeout);
  return good();
}

int read_gripper(char id, double scale, double* out) {
  Device* d = use(id);
  if (d == nullptr) return -1;
  if (out == nullptr) return fail(kErrorNull);
  if (g_model.gripper_range == 0) {
    if (!second(kGripperWithout)) return fail(kErrorNotAvailable);
    *out = 0;
    return good();
  }
  const int result = communicate(*d);
  if (result == 0) feed_estimators(*d, kReadGripper);
  if (result == kTimeGuard && second(kTimeGuardData)) return good(kTimeGuard);
  *out = side() * scale * d->seen_gripper;
  return good(result);
}

void count_force(Device& d) {
  ++d.rate_count;
  const double elapsed = now() - d.rate_since;
  if (elapsed < 0.1) return;
  d.rate = d.rate_count / elapsed / 1000.0;
  d.rate_count = 0;
  d.rate_since = now();
}

int apply_forces(char id, Vec force, Vec torque, double gripper) {
  Device* d = use(id);
  if (d == nullptr) return -1;
  for (double v : {force[0], force[1], force[2], torque[0], torque[1], torque[2], gripper})
    if (!std::isfinite(v)) return fail(kErrorInvalid);
  if (!g_model.torque && norm(torque) > 0 && second(kTorqueWithoutMotors))
    return fail(kErrorNotAvailable);
  d->fed = now();
  count_force(*d);
  if (d->mode != Mode::kForce) return second(kForceOffSet) ? fail(kErrorNotEnabled) : good();
  if (d->regulating) return good();
  const bool limited =
      static_cast<int>(cut(&force, d->max_force)) | static_cast<int>(cut(&torque, d->max_torque));
  const bool saturated = static_cast<int>(cut(&force, g_model.force)) |
                         static_cast<int>(cut(&torque, g_model.torque ? g_model.moment : 0.0));
  Vec grip{gripper, 0, 0};
  cut(&grip, d->max_gripper);
  const bool grip_cut = cut(&grip, g_model.gripper_force) && g_model.gripper_force > 0;
  d->force = force;
  d->torque = torque;
  d->gripper_force = grip[0] * (second(kGripperForceLeft) ? 1.0 : side()) *
                     (second(kGripperForceSign) ? -1.0 : 1.0);
  const bool torque_only_ignored = !g_model.torque && norm(force) < g_model.force;
  const bool full = grip_cut || (saturated && !torque_only_ignored);
  return good(full || (limited && second(kMaxForce)) ? kMotorSaturated : 0);
}

unsigned mask(Device& d) {
  unsigned pressed = d.buttons;
  const bool ready = !second(kEmulatedButton) || d.mode == Mode::kForce;
  if (d.emulate && ready && g_model.gripper_range > 0 && d.gripper.position[0] < kButtonOpening)
    pressed |= 1u;
  return pressed;
}

// ---------------------------------------------------------------- configuration

bool choose_model(std::string_view name) {
  for (const Model& model : kModels)
    if (name == model.name) return g_model = model, true;
  std::fprintf(stderr, "fake dhd: no such model '%.*s'\n", static_cast<int>(name.size()),
               name.data());
  return false;
}

void reset_devices() {
  const char* count = std::getenv("FAKE_DHD_COUNT");
  const char* calibrated = std::getenv("FAKE_DHD_CALIBRATED");
  g_devices.assign(static_cast<std::size_t>(count != nullptr ? std::atoi(count) : 1), Device{});
  for (Device& d : g_devices) {
    d.calibrated = calibrated == nullptr || std::strcmp(calibrated, "0") != 0;
    d.gripper.anchor = d.gripper.position = {0.6 * g_model.gripper_range, 0, 0};
    d.gripper.stiffness = 0.3, d.gripper.damping = 5e-3;  // N·m/rad, N·m·s/rad
    d.wrist.stiffness = 0.5, d.wrist.damping = 5e-3;
    d.effector_mass = g_model.mass;
  }
  g_default = -1;
  g_expert = false;
  g_time = 0;
  g_simulated = now();
  t_error = kNoError;
}

struct Loaded {
  Loaded() {
    const char* model = std::getenv("FAKE_DHD_MODEL");
    const char* readings = std::getenv("FAKE_DHD_READING");
    const char* clock = std::getenv("FAKE_DHD_CLOCK");
    g_virtual = clock != nullptr && std::strcmp(clock, "virtual") == 0;
    if (!fake_configure(model != nullptr ? model : "omega.3", readings != nullptr ? readings : ""))
      std::abort();
  }
} g_loaded;

using Lock = std::lock_guard<std::recursive_mutex>;

// Calls with an open device, or returns `otherwise` with an error left behind.
template <class Result, class Call>
Result with(char id, Result otherwise, Call call) {
  const Lock lock(g_mutex);
  Device* d = use(id);
  return d != nullptr ? call(*d) : otherwise;
}

template <class Call>
int with_expert(char id, Call call) {
  const Lock lock(g_mutex);
  Device* d = use_expert(id);
  return d != nullptr ? call(*d) : -1;
}

int accept(char id) {
  return with(id, -1, [](Device&) { return good(); });
}

int set_limit(char id, double Device::*limit, double value) {
  return with(id, -1, [&](Device& d) {
    d.*limit = value;
    return good();
  });
}

double get_limit(char id, double Device::*limit) {
  const Lock lock(g_mutex);
  Device* d = use(id);
  return d == nullptr ? -1.0 : d->*limit;
}

int set_window(char id, Estimator Device::*estimator, int ms, int mode) {
  return with(id, -1, [&](Device& d) {
    if (ms <= 0 || mode != 0) return fail(kErrorInvalid);
    (d.*estimator).window = ms * 1e-3;
    return good();
  });
}

}  // namespace

extern "C" {

// ---------------------------------------------------------------- what the fake adds

const char* fake_doubt(int i) {
  thread_local std::string text;
  text = g_readings.text(i);
  return text.empty() ? nullptr : text.c_str();
}

bool fake_configure(const char* model, const char* readings) {
  const Lock lock(g_mutex);
  const bool read = g_readings.choose(readings);
  const bool known = choose_model(model);
  reset_devices();
  return read && known;
}

void fake_advance(double seconds) {
  const Lock lock(g_mutex);
  if (!g_virtual) g_time = now();
  g_virtual = true;
  for (double left = seconds; left > 0; left -= 0.5) {
    g_time += std::min(left, 0.5);
    catch_up();
  }
}

void fake_set_hand(double x, double y, double z, double stiffness, double damping) {
  const Lock lock(g_mutex);
  catch_up();
  for (Device& d : g_devices) {
    d.handle.anchor = {x, y, z};
    d.handle.stiffness = stiffness;
    d.handle.damping = damping;
  }
}

void fake_set_hand_rotation(double x, double y, double z) {
  const Lock lock(g_mutex);
  catch_up();
  for (Device& d : g_devices) d.wrist.anchor = {x, y, z};
}

void fake_set_gripper_hand(double angle) {
  const Lock lock(g_mutex);
  catch_up();
  for (Device& d : g_devices) d.gripper.anchor = {angle, 0, 0};
}

void fake_press(int button, bool down) {
  const Lock lock(g_mutex);
  const unsigned bit = 1u << button;
  for (Device& d : g_devices) d.buttons = down ? d.buttons | bit : d.buttons & ~bit;
}

void fake_force_button() {
  const Lock lock(g_mutex);
  catch_up();
  for (Device& d : g_devices) forces_off(d, kCauseButton, Mode::kBrake);
}

void fake_calibrate() {
  const Lock lock(g_mutex);
  for (Device& d : g_devices) {
    d.calibrated = true;
    if (d.mode == Mode::kReset) d.mode = Mode::kBrake;
  }
}

void fake_unplug() {
  const Lock lock(g_mutex);
  for (Device& d : g_devices) forces_off(d, kCauseSoftware, Mode::kBrake), d.plugged = false;
}

void fake_truth(double position[3], double velocity[3], double force[3], double* gripper,
                double* gripper_force) {
  const Lock lock(g_mutex);
  catch_up();
  const Device& d = g_devices.front();
  for (std::size_t i = 0; i < 3; ++i) {
    position[i] = d.handle.position[i];
    velocity[i] = d.handle.velocity[i];
    force[i] = d.force[i];
  }
  *gripper = d.gripper.position[0];
  *gripper_force = d.gripper_force;
}

// ---------------------------------------------------------------- errors, ids, what a device is

int dhdErrorGetLast() { return t_error; }
const char* dhdErrorGetLastStr() { return dhdErrorGetStr(t_error); }

const char* dhdErrorGetStr(int error) {
  static constexpr std::array<const char*, 23> kTexts{"no error",
                                                      "error",
                                                      "communication error",
                                                      "controller busy",
                                                      "no driver",
                                                      "no device",
                                                      "not available on this device",
                                                      "timeout",
                                                      "geometry",
                                                      "expert mode is off",
                                                      "not implemented",
                                                      "out of memory",
                                                      "device not ready",
                                                      "no such file",
                                                      "configuration",
                                                      "index out of range",
                                                      "deprecated",
                                                      "null argument",
                                                      "redundant encoders disagree",
                                                      "not enabled",
                                                      "device in use",
                                                      "invalid argument",
                                                      "no regulation is running"};
  return error >= 0 && error < 23 ? kTexts[static_cast<std::size_t>(error)] : "unknown error";
}

void dhdEnableSimulator(bool) {}

int dhdGetDeviceCount() {
  const Lock lock(g_mutex);
  return good(static_cast<int>(std::count_if(g_devices.begin(), g_devices.end(),
                                             [](const Device& d) { return d.plugged; })));
}
int dhdGetAvailableCount() { return dhdGetDeviceCount(); }

int dhdSetDevice(char id) {
  const Lock lock(g_mutex);
  if (use(id) == nullptr) return -1;
  g_default = id;
  return good();
}
int dhdGetDeviceID() {
  const Lock lock(g_mutex);
  return g_default;
}

int dhdGetSerialNumber(unsigned short* number, char id) {
  const Lock lock(g_mutex);
  if (use(id) == nullptr) return -1;
  if (number == nullptr) return fail(kErrorNull);
  *number = 4242;
  return good();
}

int dhdOpenID(char index) {
  const Lock lock(g_mutex);
  return open_index(index, false);
}
int dhdOpen() { return dhdOpenID(0); }
int dhdOpenType(int type) { return type == g_model.type ? dhdOpenID(0) : fail(kErrorNoDevice); }
int dhdOpenSerial(int serial) { return serial == 4242 ? dhdOpenID(0) : fail(kErrorNoDevice); }
int dhdClose(char id) {
  const Lock lock(g_mutex);
  return close_device(id, false);
}

int dhdGetSystemType(char id) {
  const Lock lock(g_mutex);
  return use(id) == nullptr ? -1 : good(g_model.type);
}

const char* dhdGetSystemName(char id) {
  const Lock lock(g_mutex);
  thread_local std::string name;
  if (use(id) == nullptr) return nullptr;
  const std::string_view full = g_model.name;
  name = full.substr(0, full.find('-'));
  const bool handed = g_model.wrist && g_model.type != 64;
  if (g_model.left) name += " (left-hand)";
  if (handed && !g_model.left && second(kNames)) name += " (right-hand)";
  if (g_model.type == 60 && second(kNames)) name = "Novint Falcon";
  return name.c_str();
}

int dhdGetVersion(double* version, char id) {
  const Lock lock(g_mutex);
  if (use(id) == nullptr) return -1;
  *version = second(kEmulatedButton) ? 2.1 : 3.1;
  return good();
}

void dhdGetSDKVersion(int* major, int* minor, int* release, int* revision) {
  *major = 3, *minor = 16, *release = 0, *revision = 0;
}

int dhdGetComMode(char id) {
  const Lock lock(g_mutex);
  return use(id) == nullptr ? -1 : good(1);
}
int dhdSetComMode(int, char id) {
  const Lock lock(g_mutex);
  return use_expert(id) == nullptr ? -1 : good();
}

bool dhdIsLeftHanded(char id) {
  return with(id, false, [](Device&) { return g_model.left; });
}
bool dhdHasBase(char id) {
  return with(id, false, [](Device&) { return true; });
}
bool dhdHasWrist(char id) {
  return with(id, false, [](Device&) { return g_model.wrist; });
}
bool dhdHasActiveWrist(char id) {
  return with(id, false, [](Device&) { return g_model.torque; });
}
bool dhdHasGripper(char id) {
  return with(id, false, [](Device&) { return g_model.gripper_range > 0; });
}
bool dhdHasActiveGripper(char id) { return dhdHasGripper(id); }

// ---------------------------------------------------------------- modes

int dhdGetStatus(int* status, char id) {
  return with(id, -1, [&](Device& d) {
    if (status == nullptr) return fail(kErrorNull);
    const bool on = d.mode == Mode::kForce;
    const int cause = on && !second(kForceOffCause) ? kCauseNone : d.cause;
    // Power, connected, started; the mode; torques, wrist, error, gravity, time guard, wrist is
    // calibrated, redundancy, cause of force off, locks, axes checked.
    // clang-format off
    const std::array<int, 17> all{
        1, 1, 1, d.mode == Mode::kReset, d.mode == Mode::kIdle, on, d.mode == Mode::kBrake,
        on && g_model.torque, g_model.wrist, 0, d.gravity, d.time_guard > 0,
        g_model.wrist && d.calibrated, 0, cause, 0, 0};
    // clang-format on
    std::copy_n(all.begin(), second(kStatusFields) ? 16 : 17, status);
    return good();
  });
}

int dhdStop(char id) {
  return with(id, -1, [&](Device& d) {
    forces_off(d, kCauseSoftware, Mode::kBrake);
    d.regulating = false;
    return good();
  });
}

int dhdEnableForce(unsigned char on, char id) {
  const Lock lock(g_mutex);
  Device* d = second(kEnableForce) ? use_expert(id) : use(id);
  if (d == nullptr) return -1;
  if (on != 0 && !d->calibrated) return fail(kErrorNotReady);
  if (on == 0) {
    forces_off(*d, kCauseSoftware, Mode::kBrake);
  } else if (d->mode != Mode::kForce) {
    d->mode = Mode::kForce;
    d->fed = now();
  }
  return good();
}
int dhdEnableGripperForce(unsigned char, char id) {
  const Lock lock(g_mutex);
  return use(id) == nullptr ? -1 : g_model.gripper_range > 0 ? good() : fail(kErrorNotAvailable);
}

int dhdSetBrakes(int on, char id) {
  return with(id, -1, [&](Device& d) {
    if (on != 0) forces_off(d, kCauseSoftware, Mode::kBrake);
    if (on == 0 && second(kBrakesOff)) forces_off(d, kCauseSoftware, Mode::kIdle);
    if (on == 0 && d.mode == Mode::kBrake) d.mode = Mode::kIdle;
    return good();
  });
}

int dhdReset(char id) {
  return with(id, -1, [&](Device& d) {
    forces_off(d, kCauseSoftware, Mode::kReset);
    d.calibrated = false;
    return good();
  });
}

int dhdWaitForReset(int timeout_ms, char id) {
  if (dhdReset(id) < 0) return -1;
  dhdSleep(timeout_ms * 1e-3);
  const Lock lock(g_mutex);
  Device* d = use(id);
  return d != nullptr && d->calibrated ? good() : fail(kErrorTimeout);
}

int dhdSetStandardGravity(double, char id) { return accept(id); }
int dhdSetGravityCompensation(int on, char id) {
  return with(id, -1, [&](Device& d) {
    d.gravity = on != 0;
    return good();
  });
}
int dhdSetDeviceAngleRad(double, char id) { return accept(id); }
int dhdGetEffectorMass(double* mass, char id) {
  return with(id, -1, [&](Device& d) {
    *mass = d.effector_mass;
    return good();
  });
}
int dhdSetEffectorMass(double mass, char id) {
  return mass > 0 ? set_limit(id, &Device::effector_mass, mass) : fail(kErrorInvalid);
}

// ---------------------------------------------------------------- reading

int dhdGetPosition(double* x, double* y, double* z, char id) {
  const Lock lock(g_mutex);
  double* position[3] = {x, y, z};
  return read_pose(id, kReadPosition, position, nullptr, nullptr);
}

int dhdGetOrientationRad(double* a, double* b, double* c, char id) {
  const Lock lock(g_mutex);
  double* rotation[3] = {a, b, c};
  if (use(id) == nullptr) return -1;
  if (!g_model.wrist) return fail(kErrorNotAvailable);
  return read_pose(id, kReadOther, nullptr, rotation, nullptr);
}

int dhdGetOrientationFrame(double matrix[3][3], char id) {
  const Lock lock(g_mutex);
  return read_pose(id, kReadOther, nullptr, nullptr, matrix);
}

int dhdGetPositionAndOrientationRad(double* x, double* y, double* z, double* a, double* b,
                                    double* c, char id) {
  const Lock lock(g_mutex);
  double* position[3] = {x, y, z};
  double* rotation[3] = {a, b, c};
  if (use(id) == nullptr) return -1;
  if (!g_model.wrist && !second(kFrameWithoutWrist)) return fail(kErrorNotAvailable);
  return read_pose(id, kReadOther, position, rotation, nullptr);
}

int dhdGetPositionAndOrientationFrame(double* x, double* y, double* z, double matrix[3][3],
                                      char id) {
  const Lock lock(g_mutex);
  double* position[3] = {x, y, z};
  if (use(id) == nullptr) return -1;
  if (!g_model.wrist && !second(kFrameWithoutWrist)) return fail(kErrorNotAvailable);
  return read_pose(id, kReadOther, position, nullptr, matrix);
}

int dhdGetGripperAngleRad(double* angle, char id) {
  const Lock lock(g_mutex);
  return read_gripper(id, 1.0, angle);
}
int dhdGetGripperAngleDeg(double* angle, char id) {
  const Lock lock(g_mutex);
  return read_gripper(id, 1.0 / kDegree, angle);
}
int dhdGetGripperGap(double* gap, char id) {
  const Lock lock(g_mutex);
  const int result = read_gripper(id, kGripperLever, gap);
  if (result >= 0) *gap = std::abs(*gap);
  return result;
}

int dhdConfigLinearVelocity(int ms, int mode, char id) {
  return set_window(id, &Device::linear, ms, mode);
}
int dhdConfigAngularVelocity(int ms, int mode, char id) {
  return set_window(id, &Device::angular, ms, mode);
}
int dhdConfigGripperVelocity(int ms, int mode, char id) {
  return set_window(id, &Device::gripper_speed, ms, mode);
}

int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  const Lock lock(g_mutex);
  Vec v;
  const int result = read_speed(id, kReadLinear, &Device::linear, &v);
  if (result >= 0) *x = v[0], *y = v[1], *z = v[2];
  return result;
}

int dhdGetAngularVelocityRad(double* x, double* y, double* z, char id) {
  const Lock lock(g_mutex);
  Vec v{};
  if (use(id) == nullptr) return -1;
  if (!g_model.wrist && second(kAngularWithoutWrist)) return fail(kErrorNotAvailable);
  const int result = g_model.wrist ? read_speed(id, kReadAngular, &Device::angular, &v) : good();
  if (result >= 0) *x = v[0], *y = v[1], *z = v[2];
  return result;
}

int dhdGetGripperAngularVelocityRad(double* speed, char id) {
  const Lock lock(g_mutex);
  Vec v{};
  if (use(id) == nullptr) return -1;
  const bool has = g_model.gripper_range > 0;
  if (!has && !second(kGripperWithout)) return fail(kErrorNotAvailable);
  const int result = has ? read_speed(id, kReadGripper, &Device::gripper_speed, &v) : good();
  if (result >= 0) *speed = side() * v[0];
  return result;
}

int dhdGetButton(int index, char id) {
  return with(id, -1, [&](Device& d) {
    if (index < 0 || index >= 32) return fail(kErrorIndex);
    return good(static_cast<int>((mask(d) >> index) & 1u));
  });
}
unsigned int dhdGetButtonMask(char id) {
  const Lock lock(g_mutex);
  Device* d = use(id);
  return d == nullptr ? 0u : mask(*d);
}
int dhdEmulateButton(unsigned char on, char id) {
  return with(id, -1, [&](Device& d) {
    if (g_model.gripper_range == 0)
      return second(kEmulateWithoutGripper) ? good() : fail(kErrorNotAvailable);
    d.emulate = on != 0;
    return good();
  });
}

double dhdGetComFreq(char id) {
  const Lock lock(g_mutex);
  Device* d = use(id);
  return d == nullptr ? 0.0 : d->rate;
}

// ---------------------------------------------------------------- force

int dhdSetForce(double x, double y, double z, char id) {
  const Lock lock(g_mutex);
  return apply_forces(id, {x, y, z}, {}, 0);
}
int dhdSetForceAndTorque(double x, double y, double z, double a, double b, double c, char id) {
  const Lock lock(g_mutex);
  return apply_forces(id, {x, y, z}, {a, b, c}, 0);
}
int dhdSetForceAndGripperForce(double x, double y, double z, double gripper, char id) {
  const Lock lock(g_mutex);
  return apply_forces(id, {x, y, z}, {}, gripper);
}
int dhdSetForceAndTorqueAndGripperForce(double x, double y, double z, double a, double b, double c,
                                        double gripper, char id) {
  const Lock lock(g_mutex);
  return apply_forces(id, {x, y, z}, {a, b, c}, gripper);
}

int dhdGetForceAndTorqueAndGripperForce(double* x, double* y, double* z, double* a, double* b,
                                        double* c, double* gripper, char id) {
  return with(id, -1, [&](Device& d) {
    *x = d.force[0], *y = d.force[1], *z = d.force[2];
    *a = d.torque[0], *b = d.torque[1], *c = d.torque[2];
    *gripper = d.gripper_force;
    return good();
  });
}
int dhdGetForce(double* x, double* y, double* z, char id) {
  double a, b, c, gripper;
  return dhdGetForceAndTorqueAndGripperForce(x, y, z, &a, &b, &c, &gripper, id);
}

int dhdSetMaxForce(double limit, char id) { return set_limit(id, &Device::max_force, limit); }
int dhdSetMaxTorque(double limit, char id) { return set_limit(id, &Device::max_torque, limit); }
int dhdSetMaxGripperForce(double limit, char id) {
  return set_limit(id, &Device::max_gripper, limit);
}
double dhdGetMaxForce(char id) { return get_limit(id, &Device::max_force); }
double dhdGetMaxTorque(char id) { return get_limit(id, &Device::max_torque); }
double dhdGetMaxGripperForce(char id) { return get_limit(id, &Device::max_gripper); }
int dhdSetVibration(double, double, int, char id) { return accept(id); }

// ---------------------------------------------------------------- expert calls

int dhdEnableExpertMode() {
  const Lock lock(g_mutex);
  g_expert = true;
  return good();
}
int dhdDisableExpertMode() {
  const Lock lock(g_mutex);
  g_expert = false;
  return good();
}

int dhdSetTimeGuard(int us, char id) {
  return with_expert(id, [&](Device& d) {
    if (us < -1) return fail(kErrorInvalid);
    d.time_guard = us >= 0 ? us * 1e-6 : 1e-3;
    return good();
  });
}

int dhdSetVelocityThreshold(unsigned int value, char id) {
  return with_expert(id, [&](Device& d) {
    d.velocity_threshold = value;
    return good();
  });
}
int dhdGetVelocityThreshold(unsigned int* value, char id) {
  return with_expert(id, [&](Device& d) {
    *value = d.velocity_threshold;
    return good();
  });
}

int dhdSetWatchdog(unsigned char units, char id) {
  return with_expert(id, [&](Device& d) {
    d.watchdog = units;
    d.fed = now();
    return good();
  });
}
int dhdGetWatchdog(unsigned char* units, char id) {
  return with_expert(id, [&](Device& d) {
    *units = static_cast<unsigned char>(d.watchdog);
    return good();
  });
}

int dhdUpdateEncoders(char id) {
  return with_expert(id, [&](Device& d) {
    if (communicate(d) == 0) feed_estimators(d, kReadOther);
    return good();
  });
}

int dhdGetJointAngles(double* joints, char id) {
  return with_expert(id, [&](Device& d) {
    const int result = communicate(d);
    if (result == 0) feed_estimators(d, kReadOther);
    if (result == kTimeGuard && second(kTimeGuardData)) return good(kTimeGuard);
    for (std::size_t i = 0; i < 3; ++i) {
      joints[i] = 0.7 + d.seen_position[i] / 0.15;
      joints[i + 3] = d.seen_rotation[i];
    }
    joints[6] = side() * d.seen_gripper;
    joints[7] = 0;
    return good(result);
  });
}

int dhdGetJointAngleRange(double* low, double* high, char id) {
  const Lock lock(g_mutex);
  if (use_expert(id) == nullptr) return -1;
  for (int i = 0; i < 8; ++i) low[i] = i < 6 ? -1.5 : 0.0, high[i] = i < 6 ? 1.5 : 0.0;
  high[6] = g_model.gripper_range;
  return good();
}

int dhdJointAnglesToInertiaMatrix(double* joints, double inertia[6][6], char id) {
  const Lock lock(g_mutex);
  if (use_expert(id) == nullptr) return -1;
  if (joints == nullptr || inertia == nullptr) return fail(kErrorNull);
  const double arm = 0.15;  // m; what turns a mass at the handle into inertia at a joint.
  const double base = second(kInertia) ? g_model.mass * arm * arm : g_model.mass;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      inertia[i][j] = i != j ? 0.0 : i < 3 ? base : g_model.wrist ? kWristInertia : 0.0;
  return good();
}

// ---------------------------------------------------------------- independent of a device

bool dhdKbHit() { return false; }
double dhdGetTime() {
  const Lock lock(g_mutex);
  return now();
}
void dhdSleep(double seconds) {
  if (g_virtual)
    fake_advance(seconds);
  else
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

#ifndef FAKE_DHD_ONLY

// ---------------------------------------------------------------- the robotic library

int drdOpenID(char index) {
  const Lock lock(g_mutex);
  return open_index(index, true);
}
int drdOpen() { return drdOpenID(0); }
int drdSetDevice(char id) { return dhdSetDevice(id); }
int drdGetDeviceID() { return dhdGetDeviceID(); }
int drdClose(char id) {
  const Lock lock(g_mutex);
  return close_device(id, true);
}

// The device of a drd call, which in one reading wants a device that drdOpen* opened.
static Device* use_drd(char id) {
  Device* d = use(id);
  if (d != nullptr && second(kOpen) && !d->by_drd) return fail(kErrorNoDevice), nullptr;
  return d;
}

bool drdIsSupported(char id) {
  const Lock lock(g_mutex);
  return use_drd(id) != nullptr;
}
bool drdIsInitialized(char id) {
  const Lock lock(g_mutex);
  Device* d = use_drd(id);
  return d != nullptr && d->calibrated;
}
bool drdIsRunning(char id) {
  const Lock lock(g_mutex);
  Device* d = use_drd(id);
  return d != nullptr && d->regulating;
}
bool drdIsMoving(char) { return false; }

int drdAutoInit(char id) {
  {
    const Lock lock(g_mutex);
    if (use_drd(id) == nullptr) return -1;
  }
  dhdSleep(kInitSeconds);
  const Lock lock(g_mutex);
  Device* d = use_drd(id);
  if (d == nullptr) return -1;
  d->calibrated = true;
  d->regulating = second(kAutoInit);
  d->mode = second(kAutoInit) ? Mode::kForce : Mode::kBrake;
  d->linear.samples.clear(), d->angular.samples.clear(), d->gripper_speed.samples.clear();
  return good();
}
int drdCheckInit(char id) { return drdAutoInit(id); }

int drdStart(char id) {
  const Lock lock(g_mutex);
  Device* d = use_drd(id);
  if (d == nullptr) return -1;
  if (!d->calibrated) return fail(kErrorNotReady);
  d->regulating = true;
  d->mode = Mode::kForce;
  return good();
}

int drdStop(bool force_on, char id) {
  const Lock lock(g_mutex);
  Device* d = use_drd(id);
  if (d == nullptr) return -1;
  if (!d->regulating) return second(kDrdStop) ? fail(kErrorNoRegulation) : good();
  d->regulating = false;
  if (!force_on) forces_off(*d, kCauseSoftware, Mode::kBrake);
  return good();
}

static int drd_accepts(char id) {
  const Lock lock(g_mutex);
  return use_drd(id) == nullptr ? -1 : good();
}
int drdRegulatePos(bool, char id) { return drd_accepts(id); }
int drdRegulateRot(bool, char id) { return drd_accepts(id); }
int drdRegulateGrip(bool, char id) { return drd_accepts(id); }

#endif

}  // extern "C"
