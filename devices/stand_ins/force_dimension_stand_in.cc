// A libdhd.so without Force Dimension: the vendor's symbols, our simulated device behind them.
//
// HAPTIC_STAND_IN_MODEL names the device: "omega.3", "omega.7 (left)" and so on; sigma.7 without
// it. HAPTIC_STAND_IN_STATE has words: reset, it is not calibrated; no_power; own_window, its
// library does not let the speed's window be set. It has the symbols of libdrd.so that are needed.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "hlm/devices/stand_ins/stand_in.h"
#include "hlm/haptic_server/device/saturate.h"

using hlm::Matrix3;
using hlm::Wrench;
using hlm::server::DeviceState;
using hlm::stand_in::StandIn;
using hlm::stand_in::StandInFault;

namespace {

constexpr int kTimeGuard = 1;
constexpr int kMotorSaturated = 2;
constexpr int kError = -1;
constexpr char kId = 0;
constexpr int kSerial = 1451;
constexpr double kWatchdogUnit = 125e-6;  // s.
constexpr double kRightAngle = 1.5707963267948966;
constexpr double kOpenGripper = kRightAngle / 3;  // rad; 30°.
constexpr double kOpenLambda = kRightAngle / 6;   // rad; 15°.
constexpr double kMass = 0.3;                     // kg.
/// Positions that a speed needs within its window.
constexpr int kPositionsOfSpeed = 2;
constexpr double kEncoderStep = 10e-6;    // m.
constexpr double kVelocityWindow = 0.02;  // s; the vendor's.

std::unique_ptr<StandIn> device;
bool is_open = false;
double max_force = std::numeric_limits<double>::infinity();
double max_torque = std::numeric_limits<double>::infinity();
bool force_was_off = false;
bool was_initialized = false;
bool is_robot = false;  ///< Opened by drdOpenID().
bool emulates_button = false;
double gripper_force = 0;  ///< N.
int positions = 0;         ///< Positions that were read since the device was opened.
const char* last_error = "no error";

std::string model() {
  const char* const name = std::getenv("HAPTIC_STAND_IN_MODEL");
  return name != nullptr ? name : "sigma.7";
}

bool has_model(const char* part) { return model().find(part) != std::string::npos; }
bool wrist_is_active() { return has_model("sigma") || has_model("lambda"); }

int fail(const char* why) {
  last_error = why;
  return kError;
}

bool is_unplugged() { return device->has(StandInFault::kUnplug); }

/// 0, or the error that a call to the open device ends in.
int check(char id) {
  if (!is_open || id != kId) return fail("no device of that number is open");
  if (is_unplugged()) return fail("communication error: the device does not answer");
  if (device->has(StandInFault::kError)) return fail("the controller reports an error");
  return 0;
}

/// What a getter of values returns that has worked.
int fresh() { return device->has(StandInFault::kTimeGuard) ? kTimeGuard : 0; }

int open_device() {
  try {
    if (!device) {
      device = std::make_unique<StandIn>(
          hlm::server::SimulatedDeviceOptions{.freedom = hlm::server::DeviceFreedom::kSpatial,
                                              .mass = kMass,
                                              .damping = 2,
                                              .dry_friction = 0.02,
                                              .max_force = 20,
                                              .max_torque = wrist_is_active() ? 0.4 : 1e-4},
          hlm::stand_in::Encoders{.step = kEncoderStep, .window = kVelocityWindow});
    }
  } catch (const std::runtime_error& error) {
    static std::string why;
    why = error.what();
    return fail(why.c_str());
  }
  if (is_unplugged()) return fail("no device found");
  is_open = true;
  is_robot = false;
  positions = 0;
  return kId;
}

int give(const hlm::Vector3& v, double* x, double* y, double* z) {
  *x = v.x();
  *y = v.y();
  *z = v.z();
  return fresh();
}

int vector_of(double* x, double* y, double* z, char id, bool turns) {
  if (const int error = check(id)) return error;
  const DeviceState state = device->state();
  const Eigen::Vector3d v = turns ? state.V_WD.tail<3>() : state.V_WD.head<3>();
  return give(v, x, y, z);
}

/// What HAPTIC_STAND_IN_STATE says of the device.
bool has_word(std::string_view word) {
  const char* const words = std::getenv("HAPTIC_STAND_IN_STATE");
  return words != nullptr && std::string_view(words).find(word) != std::string_view::npos;
}

bool is_calibrated() { return was_initialized || !has_word("reset"); }

/// Of a speed, ms.
bool is_window(int ms) { return ms >= 1 && ms <= 50 && !has_word("own_window"); }

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

int dhdGetDeviceCount() { return !device || !is_unplugged() ? 1 : 0; }

int dhdOpenID(char index) { return index == kId ? open_device() : fail("no device found"); }

int dhdOpenSerial(int serial) {
  return serial == kSerial ? open_device() : fail("no device of that serial number");
}

int drdOpenID(char index) {
  const int id = dhdOpenID(index);
  is_robot = id >= 0;
  return id;
}
/// Of what drdOpenID() opened.
bool drdIsInitialized(char) { return is_robot && is_calibrated(); }

int drdAutoInit(char id) {
  if (const int error = check(id)) return error;
  if (has_word("no_power")) return fail("the device has no power");
  was_initialized = true;
  device->enable();
  return 0;
}

int drdStop(bool, char id) { return check(id); }

int dhdClose(char) {
  if (is_open) device->disable();
  is_open = false;
  return 0;
}

int drdClose(char id) { return dhdClose(id); }

int dhdStop(char id) {
  if (const int error = check(id)) return error;
  device->disable();
  return 0;
}

int dhdGetSystemType(char) { return 104; }

const char* dhdGetSystemName(char) {
  static std::string name;
  name = model();
  return name.c_str();
}

int dhdGetSerialNumber(unsigned short* serial, char id) {
  *serial = kSerial;
  return check(id);
}

bool dhdHasWrist(char) { return !has_model(".3"); }
bool dhdHasActiveWrist(char) { return wrist_is_active(); }
bool dhdHasActiveGripper(char) { return has_model(".7"); }

int dhdGetPosition(double* x, double* y, double* z, char id) {
  if (const int error = check(id)) return error;
  ++positions;
  const int result = give(device->state().X_WD.p, x, y, z);
  if (device->has(StandInFault::kNotFinite)) *x = std::numeric_limits<double>::quiet_NaN();
  return result;
}

int dhdGetPositionAndOrientationFrame(double* x, double* y, double* z, double matrix[3][3],
                                      char id) {
  if (const int error = check(id)) return error;
  if (!dhdHasWrist(id)) return fail("this device has no wrist");
  ++positions;
  const DeviceState state = device->state();
  Matrix3 R = state.X_WD.R.toRotationMatrix();
  if (device->has(StandInFault::kMirror)) R.col(2) *= -1;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) matrix[i][j] = R(i, j);
  }
  const int result = give(state.X_WD.p, x, y, z);
  if (device->has(StandInFault::kNotFinite)) *x = std::numeric_limits<double>::quiet_NaN();
  return result;
}

int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  if (positions < kPositionsOfSpeed) return fail("timeout: too few positions for a speed");
  return vector_of(x, y, z, id, false);
}

int dhdGetAngularVelocityRad(double* x, double* y, double* z, char id) {
  return vector_of(x, y, z, id, true);
}

int dhdConfigLinearVelocity(int ms, int, char id) {
  if (const int error = check(id)) return error;
  if (!is_window(ms)) return fail("this window is not possible");
  device->set_window(1e-3 * ms, true, false);
  return 0;
}

int dhdConfigAngularVelocity(int ms, int, char id) {
  if (const int error = check(id)) return error;
  if (!is_window(ms)) return fail("this window is not possible");
  device->set_window(1e-3 * ms, false, true);
  return 0;
}

int dhdGetGripperAngleRad(double* angle, char id) {
  if (const int error = check(id)) return error;
  *angle = (device->state().buttons & 1) != 0 ? 0
           : has_model("lambda")              ? kOpenLambda
                                              : kOpenGripper;
  if (has_model("left")) *angle = -*angle;
  return fresh();
}

/// Of a gripper none, unless its closing counts as button 0.
unsigned dhdGetButtonMask(char id) {
  if (check(id) != 0) return 0;
  const unsigned mask = device->state().buttons;
  return has_model(".7") && !emulates_button ? mask & ~1u : mask;
}

int dhdEmulateButton(unsigned char on, char id) {
  if (const int error = check(id)) return error;
  if (!has_model(".7")) return fail("this device has no gripper");
  emulates_button = on != 0;
  return 0;
}

int dhdGetJointAngles(double angles[8], char id) {
  std::fill_n(angles, 8, 0);
  return check(id);
}

int dhdJointAnglesToInertiaMatrix(const double[8], double inertia[6][6], char id) {
  if (has_word("no_inertia")) return fail("this device has no model");
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) inertia[i][j] = i != j ? 0 : i < 3 ? kMass : 2e-3;
  }
  return check(id);
}

/// What the gripper gives, N.
double haptic_stand_in_gripper_force() { return gripper_force; }

int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty,
                                        double tz, double grip, char id) {
  if (const int error = check(id)) return error;
  gripper_force = grip;
  Wrench F;
  F << fx, fy, fz, tx, ty, tz;
  const double most = device->has(StandInFault::kSaturate) ? 1 : max_force;
  const Wrench given = hlm::server::saturated(F, most, max_torque);
  device->command(given);
  return given.isApprox(F) ? 0 : kMotorSaturated;
}

int dhdEnableForce(unsigned char on, char id) {
  if (const int error = check(id)) return error;
  force_was_off = on == 0;
  if (on != 0) {
    device->enable();
  } else {
    device->disable();
  }
  return 0;
}

int dhdSetBrakes(int, char id) { return check(id); }
int dhdSetGravityCompensation(int, char id) { return check(id); }

int dhdSetMaxForce(double most, char id) {
  max_force = most;
  return check(id);
}

int dhdSetMaxTorque(double most, char id) {
  max_torque = most;
  return check(id);
}

bool dhdIsLeftHanded(char) { return has_model("left"); }

int dhdGetStatus(int status[17], char id) {
  if (const int error = check(id)) return error;
  std::fill_n(status, 17, 0);
  status[0] = has_word("no_power") ? 0 : 1;
  status[1] = status[2] = 1;
  status[3] = is_calibrated() ? 0 : 1;
  status[5] = device->enabled() ? 1 : 0;
  status[8] = dhdHasWrist(id) ? 1 : 0;
  if (device->enabled()) return 0;
  constexpr int kVelocity = 2;
  constexpr int kWatchdog = 3;
  constexpr int kSoftware = 4;
  status[14] = device->watchdog_has_bitten() ? kWatchdog : force_was_off ? kSoftware : kVelocity;
  return 0;
}

double dhdGetComFreq(char) { return device && device->has(StandInFault::kSlow) ? 0.2 : 4.0; }

const char* dhdErrorGetLastStr() { return last_error; }

int dhdEnableExpertMode() { return 0; }

int dhdSetWatchdog(unsigned char time, char id) {
  if (const int error = check(id)) return error;
  if (device->has(StandInFault::kBroken)) return fail("this device has no watchdog");
  device->set_watchdog(kWatchdogUnit * time);
  return 0;
}

}  // extern "C"
#pragma GCC visibility pop
