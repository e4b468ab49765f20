// A libHD.so without 3D Systems: the vendor's symbols, our simulated device behind them. Its
// scheduler is a thread, as the vendor's is.
//
// HAPTIC_STAND_IN_UNIT is the device's name in the setup, "Default Device" without it.
// HAPTIC_STAND_IN_STATE has words: needs_update, its calibration has to be updated; inkwell, its
// stylus has to be put into the inkwell.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <vector>

#include "hlm/devices/stand_ins/stand_in.h"
#include "hlm/haptic_server/device/saturate.h"

using hlm::Wrench;
using hlm::server::DeviceState;
using hlm::stand_in::StandIn;
using hlm::stand_in::StandInFault;

namespace {

using Handle = unsigned;
using Callback = unsigned (*)(void*);
struct ErrorInfo {
  unsigned code;
  int internal;
  Handle device;
};

constexpr Handle kDevice = 0;
constexpr Handle kNoDevice = 0xFFFFFFFF;
constexpr double kMetre = 1e3;             // mm.
constexpr double kMaxForce = 3.3;          // N.
constexpr double kContinuousForce = 0.88;  // N.
constexpr double kMaxStiffness = 2;        // N/mm.
constexpr double kEncoderStep = 55e-6;     // m, of a Touch.
constexpr double kVelocityCutOff = 20;     // Hz.

constexpr unsigned kAuto = 2;  // A calibration.

enum Code : unsigned {
  kSuccess = 0,
  kInvalid = 0x0100,
  kInvalidValue = 0x0101,
  kExceededMaxForce = 0x0201,
  kForceError = 0x0204,
  kDeviceFault = 0x0300,
  kIllegalEnd = 0x0401,
  kAlreadyOpen = 0x0301,
  kCommunication = 0x0302,
};

std::unique_ptr<StandIn> device;
DeviceState state;              ///< State in the present frame.
Wrench force = Wrench::Zero();  ///< Force in the present frame.
/// Its stack of errors, the latest last.
std::mutex errors_mutex;
std::vector<unsigned> errors;
/// Frames since the scheduler was started: the first ones are none, then some give a default pose.
std::atomic<int> frames = 0;
constexpr int kIllegalFrames = 8;
constexpr int kDefaultFrames = 5;
bool is_open = false;
bool clamps = false;

Callback callback = nullptr;
void* callback_data = nullptr;
std::atomic<unsigned long> rate = 1000;  ///< Hz.

bool is_updated = false;

std::string_view variable(const char* name, std::string_view otherwise) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : otherwise;
}

bool has_word(std::string_view word) {
  return variable("HAPTIC_STAND_IN_STATE", "").find(word) != std::string_view::npos;
}

void report(Code code) {
  const std::lock_guard lock(errors_mutex);
  if (errors.size() < 100) errors.push_back(code);
}

bool has_errors() {
  const std::lock_guard lock(errors_mutex);
  return !errors.empty();
}

void run_scheduler(const std::stop_token& stop) {
  hlm::stand_in::run_as_hardware();
  auto next = std::chrono::steady_clock::now();
  while (!stop.stop_requested()) {
    const unsigned long present = device->has(StandInFault::kSlow) ? 200 : rate.load();
    next = std::max(next + std::chrono::nanoseconds(1'000'000'000 / present),
                    std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
    if (callback != nullptr && !device->has(StandInFault::kBroken)) callback(callback_data);
  }
}

/// After the device: it goes first.
std::jthread scheduler;

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

Handle hdInitDevice(const char* name) {
  try {
    if (!device) {
      device = std::make_unique<StandIn>(
          hlm::server::SimulatedDeviceOptions{.freedom = hlm::server::DeviceFreedom::kSpatial,
                                              .mass = 0.1,
                                              .damping = 2,
                                              .dry_friction = 0.02,
                                              .max_force = kMaxForce,
                                              .max_torque = 1e-4},
          hlm::stand_in::Encoders{.step = kEncoderStep, .cutoff = kVelocityCutOff});
    }
  } catch (const std::runtime_error&) {
    report(kDeviceFault);
    return kNoDevice;
  }
  if (name != nullptr && name != variable("HAPTIC_STAND_IN_UNIT", "Default Device")) {
    report(kInvalid);
  };
  if (device->has(StandInFault::kUnplug)) report(kCommunication);
  if (is_open) report(kAlreadyOpen);
  if (has_errors()) return kNoDevice;
  is_open = true;
  return kDevice;
}

void hdDisableDevice(Handle) {
  device->disable();
  is_open = false;
}
void hdMakeCurrentDevice(Handle) {}

void hdBeginFrame(Handle) { state = device->state(); }

void hdEndFrame(Handle) {
  if (++frames <= kIllegalFrames) return report(kIllegalEnd);
  if (device->has(StandInFault::kUnplug)) return report(kCommunication);
  if (device->has(StandInFault::kError)) return report(kDeviceFault);
  if (device->has(StandInFault::kForceOff)) return report(kForceError);
  const double most = device->has(StandInFault::kSaturate) ? 0.5 : kMaxForce;
  const Wrench given = hlm::server::saturated(force, most, 0);
  if (!given.isApprox(force)) report(kExceededMaxForce);
  if (clamps || given.isApprox(force)) device->command(given);
}

ErrorInfo hdGetError() {
  const std::lock_guard lock(errors_mutex);
  const unsigned code = errors.empty() ? kSuccess : errors.back();
  if (!errors.empty()) errors.pop_back();
  return {code, 0, kDevice};
}

void hdEnable(unsigned capability) {
  if (capability == 0x4000) device->enable();
  if (capability == 0x4001) clamps = true;
}

void hdDisable(unsigned capability) {
  if (capability == 0x4000) device->disable();
  if (capability == 0x4001) clamps = false;
}

void hdGetDoublev(unsigned parameter, double* values) {
  const auto give = [values](const hlm::Vector3& v) { std::copy_n(v.data(), 3, values); };
  switch (parameter) {
    case 0x2051:
      return give(kMetre * state.V_WD.head<3>());
    case 0x2053:
      return give(state.V_WD.tail<3>());
    case 0x2052: {
      Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
      X.topLeftCorner<3, 3>() = state.X_WD.R.toRotationMatrix();
      X.topRightCorner<3, 1>() = kMetre * state.X_WD.p;
      if (frames < kIllegalFrames + kDefaultFrames) {
        X.topRightCorner<3, 1>() = Eigen::Vector3d(0, -110, -35);
      }
      if (device->has(StandInFault::kMirror)) X.col(2) *= -1;
      if (device->has(StandInFault::kNotFinite)) X(0, 3) = std::numeric_limits<double>::quiet_NaN();
      std::copy_n(X.data(), 16, values);
      return;
    }
    case 0x2602:
      *values = kMaxStiffness;
      return;
    case 0x2603:
      *values = kMaxForce;
      return;
    case 0x2604:
      *values = kContinuousForce;
      return;
    case 0x2605:
      std::fill_n(values, 3, has_word("warm") ? 0.9 : 0.1);
      return;
    default:
      report(kInvalid);
  }
}

unsigned hdCheckCalibration() {
  if (has_word("inkwell")) return 0x5002;
  return has_word("needs_update") && !is_updated ? 0x5001 : 0x5000;
}

void hdUpdateCalibration(unsigned style) {
  if (style != kAuto) return report(kInvalidValue);
  is_updated = true;
}

void hdGetIntegerv(unsigned parameter, int* values) {
  if (parameter == 0x2555) {
    *values = kAuto | 4;
    return;
  }
  if (parameter != 0x2000) return report(kInvalid);
  *values = static_cast<int>(state.buttons);
}

void hdSetDoublev(unsigned parameter, const double* values) {
  if (parameter != 0x2700) return report(kInvalid);
  force.setZero();
  std::copy_n(values, 3, force.data());
}

const char* hdGetString(unsigned) { return "Touch"; }

unsigned long hdScheduleAsynchronous(Callback function, void* data, unsigned short) {
  callback = function;
  callback_data = data;
  return 1;
}

void hdUnschedule(unsigned long) { callback = nullptr; }

void hdStartScheduler() {
  frames = 0;
  scheduler = std::jthread(run_scheduler);
}

void hdStopScheduler() {
  if (!scheduler.joinable()) return;
  scheduler.request_stop();
  scheduler.join();
}

void hdSetSchedulerRate(unsigned long hertz) {
  if (hertz != 500 && hertz != 1000 && hertz != 2000) return report(kInvalidValue);
  rate = hertz;
}

}  // extern "C"
#pragma GCC visibility pop
