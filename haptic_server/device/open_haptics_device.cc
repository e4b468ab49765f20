#include "hlm/device/open_haptics_device.h"

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <utility>

namespace hlm::server {
namespace {

using Library = OpenHapticsLibrary;

constexpr double kMillimetre = 1e-3;          // m.
constexpr double kNewtonPerMillimetre = 1e3;  // N/m.
/// A state that is older is late, s: the scheduler's period and what a busy machine adds.
constexpr double kLate = 4e-3;
/// A speed is not that of a longer time, s.
constexpr double kLongestStep = 0.1;
/// Time that calibrate() waits for the first state.
constexpr std::chrono::seconds kFirstState{3};
constexpr std::uint8_t kButtons = 4;

double age(std::chrono::steady_clock::time_point time) noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - time).count();
}

/// What a device that does not say is rated for: little.
double rating(const Library& hd, unsigned parameter, double otherwise) {
  double value = 0;
  hd.get_doubles(parameter, &value);
  return hd.get_error().code == 0 && value > 0 ? value : otherwise;
}

}  // namespace

OpenHapticsDevice::OpenHapticsDevice(std::shared_ptr<const Library> library,
                                     const OpenHapticsOptions& options)
    : OpenHapticsDevice(options, std::move(library)) {
  const Library& hd = *library_;
  open_first();
  const char* const model = hd.get_string(Library::kModel);
  name_ = std::string("OpenHaptics ") + (model != nullptr ? model : "device");
  ratings_.max_force = rating(hd, Library::kMaxForce, 1);
  ratings_.max_stiffness = kNewtonPerMillimetre * rating(hd, Library::kMaxStiffness, 0.5);
  ratings_.max_torque = 0;
  ratings_.buttons = kButtons;
  ratings_.exchange_rate = options_.rate;
  if (options_.velocity_cutoff > 0) {
    ratings_.velocity_lag = 1 / (2 * std::numbers::pi * options_.velocity_cutoff);
  }
  throw_if(start());
  reopener_.emplace([this] {
    close();
    return open() == nullptr && start() == nullptr;
  });
}

OpenHapticsDevice::~OpenHapticsDevice() {
  reopener_.reset();
  close();
}

void OpenHapticsDevice::refuse(const std::string& unit, const std::string& why) const {
  throw std::runtime_error("the device '" + unit + "' cannot be opened through " +
                           library_->library.name() + ": " + why);
}

void OpenHapticsDevice::throw_if(const char* why) const {
  if (why != nullptr) refuse(options_.unit, why);
}

/// By the name that was given, or by the first one that the library knows, which is kept.
void OpenHapticsDevice::open_first() {
  if (!options_.unit.empty()) return throw_if(open());
  std::string units;
  std::string causes;
  for (const char* const unit : kOpenHapticsUnits) {
    options_.unit = unit;
    const char* const why = open();
    if (why == nullptr) return;
    units += (units.empty() ? "" : "' or '") + std::string(unit);
    causes += (causes.empty() ? "" : "; ") + std::string(why);
  }
  refuse(units, causes + "; the key unit names another one");
}

const char* OpenHapticsDevice::open() noexcept {
  const Library& hd = *library_;
  handle_ = hd.init_device(options_.unit.c_str());
  const char* const why = cause_of_error(hd.get_error().code);
  if (handle_ == Library::kNoDevice) return why != nullptr ? why : "the library finds none";
  gives_force_ = false;
  hd.make_current(handle_);
  hd.disable(Library::kForceOutput);
  hd.enable(Library::kForceClamping);
  return cause_of_error(hd.get_error().code);
}

const char* OpenHapticsDevice::start() noexcept {
  const Library& hd = *library_;
  hd.set_scheduler_rate(static_cast<unsigned long>(options_.rate));
  callback_ = hd.schedule(&OpenHapticsDevice::exchange, this, Library::kHighestPriority);
  hd.start_scheduler();
  return cause_of_error(hd.get_error().code);
}

void OpenHapticsDevice::close() noexcept {
  if (handle_ == Library::kNoDevice) return;
  const Library& hd = *library_;
  hd.stop_scheduler();
  hd.unschedule(callback_);
  hd.disable_device(handle_);
  handle_ = Library::kNoDevice;
}

void OpenHapticsDevice::calibrate() {
  const auto begin = Clock::now();
  while (readings_.get().time == Clock::time_point{}) {
    if (Clock::now() - begin > kFirstState) {
      throw std::runtime_error(name_ + " gives no state: its scheduler does not run");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  while (calibration_ != Library::kCalibrated && Clock::now() - begin < kFirstState) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (calibration_ == Library::kCalibrated) return;
  throw std::runtime_error(name_ +
                           " is not calibrated: put its stylus into the inkwell, or use the "
                           "vendor's setup");
}

/// A device whose library calibrates it by itself, or in its inkwell, is told to as long as its
/// motors are off: its pose jumps.
void OpenHapticsDevice::update_calibration() noexcept {
  const Library& hd = *library_;
  if (hd.check_calibration == nullptr || hd.update_calibration == nullptr) return;
  unsigned calibration = hd.check_calibration();
  if (calibration == Library::kNeedsUpdate) {
    int styles = 0;
    hd.get_integers(Library::kCalibrationStyle, &styles);
    const int style = (styles & Library::kAuto) != 0 ? Library::kAuto : Library::kInkwell;
    if ((styles & style) != 0) hd.update_calibration(static_cast<unsigned>(style));
    calibration = hd.check_calibration();
  }
  calibration_ = calibration;
}

unsigned OpenHapticsDevice::exchange(void* device) noexcept {
  static_cast<OpenHapticsDevice*>(device)->exchange();
  return Library::kContinue;
}

/// One period of the scheduler, in its thread.
void OpenHapticsDevice::exchange() noexcept {
  const Library& hd = *library_;
  if (!enabled_) update_calibration();
  hd.begin_frame(handle_);
  const Clock::time_point began = Clock::now();
  Reading reading;
  int buttons = 0;
  std::array<double, 16> transform{};
  hd.get_integers(Library::kButtons, &buttons);
  hd.get_doubles(Library::kTransform, transform.data());
  hd.get_doubles(Library::kVelocity, reading.V.data());
  hd.get_doubles(Library::kAngularVelocity, reading.V.data() + 3);
  const Eigen::Map<const Eigen::Matrix4d> X(transform.data());
  reading.R = X.topLeftCorner<3, 3>();
  reading.p = kMillimetre * X.topRightCorner<3, 1>();
  reading.V.head<3>() *= kMillimetre;
  reading.buttons = static_cast<std::uint32_t>(buttons);

  const bool enabled = enabled_.load(std::memory_order_acquire);
  if (enabled != std::exchange(gives_force_, enabled)) {
    (enabled ? hd.enable : hd.disable)(Library::kForceOutput);
  }
  const Command& command = commands_.get();
  Vector3 force = Vector3::Zero();
  if (enabled && age(command.time) <= options_.oldest) force = command.force;
  hd.set_doubles(Library::kForce, force.data());
  hd.end_frame(handle_);

  const unsigned code = hd.get_error().code;
  reading.saturated = says_saturated(code);
  unsigned none = 0;
  if (cause_of_error(code) != nullptr) error_.compare_exchange_strong(none, code);
  reading.time = Clock::now();
  reading.v = reading.V.head<3>();
  if (options_.velocity_cutoff > 0) {
    reading.v = speed_.filtered(reading.p, began, options_.velocity_cutoff);
  }
  readings_.put(reading);
}

Vector3 OpenHapticsDevice::SpeedFilter::filtered(const Vector3& position, Clock::time_point time,
                                                 double cutoff) noexcept {
  const double dt = std::chrono::duration<double>(time - latest).count();
  const bool is_known = latest != Clock::time_point{} && v.allFinite() && p.allFinite();
  const bool goes_on = is_known && dt > 0 && dt < kLongestStep;
  const double gain = -std::expm1(-2 * std::numbers::pi * cutoff * dt);
  v = goes_on ? Vector3(v + gain * ((position - p) / dt - v)) : Vector3(Vector3::Zero());
  p = position;
  latest = time;
  return v;
}

void OpenHapticsDevice::enable() noexcept {
  if (!reopener_->is_there()) return;
  failed_ = false;
  cause_ = "";
  motion_.begin();
  error_ = 0;
  commands_.put({Clock::now(), Vector3::Zero()});
  enabled_.store(true, std::memory_order_release);
}

void OpenHapticsDevice::disable() noexcept {
  enabled_.store(false, std::memory_order_release);
  if (failed_ && reopener_->is_there()) reopener_->lose();
}

std::optional<DeviceState> OpenHapticsDevice::fail(const char* cause) noexcept {
  if (!failed_) cause_ = cause;
  failed_ = true;
  return std::nullopt;
}

std::optional<DeviceState> OpenHapticsDevice::read() noexcept {
  if (!reopener_->is_there() || failed_) return std::nullopt;
  const Reading& reading = readings_.get();
  if (const char* why = cause_of_error(error_)) return fail(why);
  const double old = age(reading.time);
  if (old > options_.oldest) return fail("the vendor's scheduler gives no new state");
  const double time = std::chrono::duration<double>(reading.time.time_since_epoch()).count();
  if (const char* why = motion_.find_error(time, reading.p, reading.R, reading.V, false)) {
    return fail(why);
  }
  DeviceState state;
  state.X_WD = {reading.p, Quaternion(reading.R).normalized()};
  state.V_WD << reading.v, reading.V.tail<3>();
  state.buttons = reading.buttons;
  if (reading.saturated) {
    state.health = DeviceHealth::kSaturated;
    cause_ = "more was commanded than it can give";
  } else if (old > kLate) {
    state.health = DeviceHealth::kLate;
    cause_ = "the vendor's scheduler gives new states too seldom";
  }
  return state;
}

bool OpenHapticsDevice::write(const Wrench& F) noexcept {
  if (!reopener_->is_there() || failed_) return false;
  if (!F.allFinite()) {
    fail("it was commanded a wrench that is not finite");
    return false;
  }
  commands_.put({Clock::now(), F.head<3>()});
  return true;
}

}  // namespace hlm::server
