#include "hlm/devices/open_haptics_device.h"

#include <algorithm>
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
/// The library's pose before it has read one, m, if it is not zero, and how long such a pose is
/// taken for that.
const Vector3 kDefaultPosition(0, -0.110, -0.035);
constexpr double kDefaultTolerance = 1e-7;  // m.
constexpr std::chrono::seconds kDefaultTime{1};
/// Frames between two looks at the motors' temperature.
constexpr std::uint64_t kTemperatureFrames = 100;
/// Motors are warm from the first, and cool again below the second; of 1, where they are hot.
constexpr double kWarmFrom = 0.8;
constexpr double kCoolBelow = 0.6;
/// More errors are not on the library's stack.
constexpr int kMostErrors = 32;
/// Time that calibrate() waits for the first state.
constexpr std::chrono::seconds kFirstState{3};
constexpr std::uint8_t kButtons = 4;
/// What the library's own speed is taken to be smoothed by, Hz.
constexpr double kVendorsVelocityCutOff = 20;

double age(std::chrono::steady_clock::time_point time) noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - time).count();
}

/// From the vendor's data sheets, the library's own values before them. Masses are with what of a
/// stylus a hand moves; the delay is that of the scheduler's thread.
constexpr double kSchedulerDelay = 1e-3;
constexpr std::array<DeviceModel, 7> kOpenHapticsModels{{
    {.name = "Touch X",
     .force = 7.9,
     .continuous_force = 1.75,
     .stiffness = 1860,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 23e-6,
     .cutoff = 60},
    {.name = "Touch",
     .force = 3.3,
     .continuous_force = 0.88,
     .stiffness = 1000,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 55e-6,
     .cutoff = 40},
    {.name = "Omni",
     .force = 3.3,
     .continuous_force = 0.88,
     .stiffness = 1000,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 55e-6,
     .cutoff = 40},
    {.name = "Desktop",
     .force = 7.9,
     .continuous_force = 1.75,
     .stiffness = 1860,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 23e-6,
     .cutoff = 60},
    {.name = "Premium 3.0",
     .force = 22,
     .continuous_force = 3,
     .stiffness = 1000,
     .mass = 0.2,
     .delay = kSchedulerDelay,
     .step = 20e-6,
     .cutoff = 60},
    {.name = "Premium",
     .force = 8.5,
     .continuous_force = 1.4,
     .stiffness = 3500,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 30e-6,
     .cutoff = 60},
    {.name = "",
     .force = 1,
     .continuous_force = 0.5,
     .stiffness = 500,
     .mass = 0.1,
     .delay = kSchedulerDelay,
     .step = 55e-6,
     .cutoff = 40},
}};

}  // namespace

std::span<const DeviceModel> open_haptics_models() noexcept { return kOpenHapticsModels; }

DeviceRatings open_haptics_ratings(const DeviceModel& model, const OpenHapticsOptions& options) {
  DeviceRatings ratings = ratings_of(model);
  ratings.max_torque = 0;
  ratings.buttons = kButtons;
  ratings.exchange_rate = options.rate;
  const double own = options.velocity_cutoff.value_or(model.cutoff);
  rate_speed(model, own > 0 ? own : kVendorsVelocityCutOff, 1 / options.rate, ratings);
  return ratings;
}

OpenHapticsDevice::OpenHapticsDevice(std::shared_ptr<const Library> library,
                                     const OpenHapticsOptions& options)
    : OpenHapticsDevice(options, std::move(library)) {
  const Library& hd = *library_;
  open_first();
  const char* const model = hd.get_string(Library::kModel);
  name_ = std::string("OpenHaptics ") + (model != nullptr ? model : "device");
  const DeviceModel& row = model_of(kOpenHapticsModels, name_);
  ratings_ = open_haptics_ratings(row, options_);
  cutoff_ = options_.velocity_cutoff.value_or(row.cutoff);
  const auto take = [&](unsigned parameter, double unit, double& rating) {
    double value = 0;
    hd.get_doubles(parameter, &value);
    if (errors(hd).failure == 0 && std::isfinite(value) && value > 0) rating = unit * value;
  };
  take(Library::kMaxForce, 1, ratings_.max_force);
  take(Library::kMaxContinuousForce, 1, ratings_.continuous_force);
  take(Library::kMaxStiffness, kNewtonPerMillimetre, ratings_.max_stiffness);
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

/// All of them: what stays on the stack would be taken for an error of a later call.
OpenHapticsDevice::Errors OpenHapticsDevice::errors(const Library& hd) noexcept {
  Errors all;
  for (int i = 0; i < kMostErrors; ++i) {
    const unsigned code = hd.get_error().code;
    if (code == 0) break;
    all.saturated |= says_saturated(code);
    all.warm |= says_warm(code);
    all.no_frame |= says_no_frame(code);
    if (cause_of_error(code) != nullptr) all.failure = code;  // The oldest is the last.
  }
  return all;
}

const char* OpenHapticsDevice::open() noexcept {
  const Library& hd = *library_;
  errors(hd);  // Of an earlier device.
  handle_ = hd.init_device(options_.unit.c_str());
  const char* const why = cause_of_error(errors(hd).failure);
  if (handle_ == Library::kNoDevice) return why != nullptr ? why : "the library finds none";
  gives_force_ = false;
  hd.make_current(handle_);
  hd.disable(Library::kForceOutput);
  hd.enable(Library::kForceClamping);
  return cause_of_error(errors(hd).failure);
}

const char* OpenHapticsDevice::start() noexcept {
  const Library& hd = *library_;
  started_ = Clock::now();
  gives_frames_ = false;
  speed_.begin();
  hd.set_scheduler_rate(static_cast<unsigned long>(options_.rate));
  errors(hd);  // A device whose rate cannot be set has its own.
  callback_ = hd.schedule(&OpenHapticsDevice::exchange, this, Library::kHighestPriority);
  hd.start_scheduler();
  const unsigned failure = errors(hd).failure;
  return says_no_frame(failure) ? nullptr : cause_of_error(failure);
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
  if (frames_++ % kTemperatureFrames == 0) observe_temperature();
  errors(hd);  // Of what was asked besides.
  hd.begin_frame(handle_);
  const Clock::time_point began = Clock::now();
  Reading reading = read_frame();
  const bool enabled = enabled_.load(std::memory_order_acquire);
  if (enabled != std::exchange(gives_force_, enabled)) {
    (enabled ? hd.enable : hd.disable)(Library::kForceOutput);
  }
  const Command& command = commands_.get();
  Vector3 force = Vector3::Zero();
  if (enabled && age(command.time) <= options_.oldest) force = command.force;
  hd.set_doubles(Library::kForce, force.data());
  hd.end_frame(handle_);

  const Errors reported = errors(hd);
  if (!is_real(reading, reported)) return;
  unsigned none = 0;
  if (reported.failure != 0) error_.compare_exchange_strong(none, reported.failure);
  reading.saturated = reported.saturated;
  reading.warm = warm_ || reported.warm;
  reading.time = Clock::now();
  reading.v = reading.V.head<3>();
  if (cutoff_ > 0) {
    const double time = std::chrono::duration<double>(began.time_since_epoch()).count();
    const double lag = 1 / (2 * std::numbers::pi * cutoff_);
    reading.v = speed_.filtered({reading.p, Quaternion::Identity()}, time, lag).head<3>();
  }
  readings_.put(reading);
}

OpenHapticsDevice::Reading OpenHapticsDevice::read_frame() noexcept {
  const Library& hd = *library_;
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
  return reading;
}

/// Whether the device was there to be read. What is not leaves the latest reading to grow old.
bool OpenHapticsDevice::is_real(const Reading& reading, const Errors& reported) noexcept {
  if (reported.no_frame) return false;
  const bool is_default = (reading.p - kDefaultPosition).norm() < kDefaultTolerance ||
                          reading.p.norm() < kDefaultTolerance || reading.R.isZero();
  if (!gives_frames_ && is_default && Clock::now() - started_ < kDefaultTime) return false;
  gives_frames_ = true;
  return true;
}

/// A library that does not know it is not asked again.
void OpenHapticsDevice::observe_temperature() noexcept {
  if (!says_temperature_) return;
  const Library& hd = *library_;
  errors(hd);
  std::array<double, 6> temperatures{};
  hd.get_doubles(Library::kMotorTemperature, temperatures.data());
  const Errors reported = errors(hd);
  if (reported.no_frame) return;
  says_temperature_ = reported.failure == 0;
  const double warmest = *std::max_element(temperatures.begin(), temperatures.end());
  if (says_temperature_) warm_ = warmest > (warm_ ? kCoolBelow : kWarmFrom);
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
  state.warm = reading.warm;
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
