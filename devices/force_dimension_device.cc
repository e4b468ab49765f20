#include "hlm/devices/force_dimension_device.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace hlm::server {
namespace {

using Library = ForceDimensionLibrary;

/// The unit of the vendor's watchdog, s.
constexpr double kWatchdogUnit = 125e-6;
/// A library that cannot be told otherwise takes the mean over that time, s.
constexpr double kVendorsWindow = 0.02;
/// Between two looks at the device's status, s. It is not needed for the force.
constexpr double kStatusPeriod = 5e-3;
/// After motors were put on, s: their status follows.
constexpr double kStatusPatience = 0.05;
/// Buttons of the mask that the library gives.
constexpr std::uint8_t kButtons = 16;
/// What a handle's apparent mass, kg, and inertia, kg·m², can be.
constexpr Range kMasses{0.05, 5};
constexpr Range kInertias{1e-7, 0.1};

constexpr double degrees(double angle) noexcept { return angle * std::numbers::pi / 180; }

/// Masses are usual ones, for libraries that do not say; so are the delay, of USB and of the
/// controller's 4 kHz, and all that stands in the last row. Gripper forces that are not documented
/// are 0.
constexpr double kUsbDelay = 0.25e-3;
constexpr std::array<DeviceModel, 8> kForceDimensionModels{{
    {.name = "omega.7",
     .force = 12,
     .stiffness = 5000,
     .angular_stiffness = 0.5,
     .mass = 0.25,
     .delay = kUsbDelay,
     .step = 10e-6,
     .angle_step = degrees(0.09),
     .cutoff = 100,
     .gripper_range = degrees(30),
     .gripper_force = 8,
     .gripper_travel = 0.025},
    {.name = "omega",
     .force = 12,
     .stiffness = 5000,
     .angular_stiffness = 0.5,
     .mass = 0.25,
     .delay = kUsbDelay,
     .step = 10e-6,
     .angle_step = degrees(0.09),
     .cutoff = 100},
    {.name = "sigma",
     .force = 12,
     .torque = 0.2,
     .stiffness = 4000,
     .angular_stiffness = 1,
     .mass = 0.3,
     .delay = kUsbDelay,
     .step = 1.5e-6,
     .angle_step = degrees(0.013),
     .cutoff = 100,
     .gripper_range = degrees(30),
     .gripper_force = 8,
     .gripper_travel = 0.025},
    {.name = "lambda.7",
     .force = 12,
     .torque = 0.2,
     .stiffness = 8000,
     .angular_stiffness = 0.5,
     .mass = 0.3,
     .delay = kUsbDelay,
     .step = 1.5e-6,
     .angle_step = degrees(0.013),
     .cutoff = 100,
     .gripper_range = degrees(15)},
    {.name = "lambda",
     .force = 12,
     .torque = 0.2,
     .stiffness = 8000,
     .angular_stiffness = 0.5,
     .mass = 0.3,
     .delay = kUsbDelay,
     .step = 1.5e-6,
     .angle_step = degrees(0.013),
     .cutoff = 100},
    {.name = "delta",
     .force = 20,
     .torque = 0.1,
     .stiffness = 5000,
     .angular_stiffness = 0.5,
     .mass = 0.25,
     .delay = kUsbDelay,
     .step = 30e-6,
     .angle_step = degrees(0.04),
     .cutoff = 60},
    {.name = "Falcon",
     .force = 5,
     .stiffness = 2000,
     .mass = 0.25,
     .delay = kUsbDelay,
     .step = 60e-6,
     .cutoff = 40},
    {.name = "",
     .force = 5,
     .torque = 0.1,
     .stiffness = 2000,
     .angular_stiffness = 0.5,
     .mass = 0.25,
     .delay = kUsbDelay,
     .step = 30e-6,
     .angle_step = degrees(0.09),
     .cutoff = 60,
     .gripper_range = degrees(30)},
}};

double seconds_now() noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::span<const DeviceModel> force_dimension_models() noexcept { return kForceDimensionModels; }

DeviceRatings force_dimension_ratings(const DeviceModel& model, bool active_wrist,
                                      const ForceDimensionOptions& options, double dt) noexcept {
  DeviceRatings ratings = ratings_of(model);
  if (!active_wrist) ratings.max_torque = 0;
  const double cutoff = options.velocity_cutoff.value_or(model.cutoff);
  if (cutoff > 0) {
    rate_speed(model, cutoff, dt, ratings);
    return ratings;
  }
  const double window = std::max(options.velocity_window, dt);
  ratings.velocity_lag = window / 2;
  ratings.speed_step = model.step / window;
  ratings.turn_step = model.angle_step / window;
  return ratings;
}

const char* cause_of_force_off(int cause) noexcept {
  switch (cause) {
    case 1:
      return "its force button is off";
    case 2:
      return "it was faster than its velocity threshold";
    case 3:
      return "its watchdog has had no command in time";
    case 4:
      return "a program has taken them off";
    case 5:
      return "its cable was unplugged";
    case 6:
      return "its dead man's switch is open";
    default:
      return "it does not say why";
  }
}

ForceDimensionDevice::ForceDimensionDevice(std::shared_ptr<const Library> library,
                                           const ForceDimensionOptions& options, double dt)
    : library_(std::move(library)), options_(options), dt_(dt) {
  open();
  const Library& dhd = *library_;
  name_ = "Force Dimension " + model();
  serial_ = serial();
  const bool active_wrist = dhd.has_active_wrist(id_);
  has_wrist_ = active_wrist || (dhd.has_wrist != nullptr && dhd.has_wrist(id_));
  model_ = &model_of(kForceDimensionModels, name_);
  ratings_ = force_dimension_ratings(*model_, active_wrist, options_, dt_);
  cutoff_ = options_.velocity_cutoff.value_or(model_->cutoff);
  ratings_.freedoms = has_wrist_ ? kAllFreedoms : Freedoms{0b000111};
  ratings_.buttons = kButtons;
  const bool grips = dhd.has_active_gripper(id_);
  ratings_.gripper = grips || (dhd.has_gripper != nullptr && dhd.has_gripper(id_));
  if (!grips) ratings_.max_gripper_force = 0;
  if (!prepare()) {
    const std::string why = cause_;
    close();
    throw std::runtime_error(name_ + " cannot be prepared: " + why);
  }
  if (cutoff_ == 0) ratings_.velocity_lag = window_ / 2;
  read_inertia();
  if (has_watchdog_) ratings_.time_guard = options_.watchdog;
  read_pose(p_, R_);
  reopener_.emplace([this] { return reopen(); });
}

ForceDimensionDevice::~ForceDimensionDevice() {
  reopener_.reset();
  library_->stop(id_);
  close();
}

void ForceDimensionDevice::close() noexcept {
  (is_robot_ ? library_->robot_close : library_->close)(id_);
}

/// By libdrd.so's own call where there is one: only such a device can be asked whether it is
/// calibrated.
void ForceDimensionDevice::open() {
  const Library& dhd = *library_;
  const int id = options_.serial > 0 ? open_serial() : open_number(options_.number);
  if (id < 0) {
    const std::string which = options_.serial > 0
                                  ? "with serial number " + std::to_string(options_.serial)
                                  : "number " + std::to_string(options_.number);
    throw std::runtime_error("no Force Dimension device " + which + " can be opened through " +
                             dhd.library.name() + ": " + dhd.last_error() +
                             "; check its power, its cable, and the right to its USB port");
  }
  id_ = static_cast<char>(id);
}

/// The device's id, below 0 if it cannot be opened.
int ForceDimensionDevice::open_number(int number) noexcept {
  const Library& dhd = *library_;
  is_robot_ = dhd.robot_open_id != nullptr && dhd.robot_close != nullptr;
  const int id = is_robot_ ? dhd.robot_open_id(static_cast<char>(number)) : -1;
  if (id >= 0) return id;
  is_robot_ = false;
  return dhd.open_id(static_cast<char>(number));
}

/// libdrd.so opens by number alone: the devices are opened one after the other until one has that
/// serial number.
int ForceDimensionDevice::open_serial() noexcept {
  const Library& dhd = *library_;
  for (int i = 0; dhd.serial_number != nullptr && i < dhd.device_count(); ++i) {
    const int id = open_number(i);
    if (id < 0) continue;
    id_ = static_cast<char>(id);
    if (serial() == options_.serial) return id;
    close();
  }
  is_robot_ = false;
  return dhd.open_serial(options_.serial);
}

void ForceDimensionDevice::calibrate() {
  if (options_.auto_init) auto_init();
  if (const char* const why = find_unready()) throw std::runtime_error(name_ + ' ' + why);
}

void ForceDimensionDevice::auto_init() {
  const Library& dhd = *library_;
  const bool can = is_robot_ && dhd.is_initialized != nullptr && dhd.auto_init != nullptr &&
                   dhd.robot_stop != nullptr;
  if (!can) {
    throw std::runtime_error("auto-init true needs libdrd.so: " + dhd.library.name() +
                             " cannot calibrate a device");
  }
  if (dhd.is_initialized(id_)) return;
  const bool calibrated = dhd.auto_init(id_) >= 0;
  dhd.robot_stop(true, id_);  // An error where it holds nothing.
  if (!calibrated) {
    throw std::runtime_error(name_ + " could not be calibrated: " + dhd.last_error());
  }
  dhd.enable_force(0, id_);
}

/// libdrd.so says it of what it opened; without that the status does.
bool ForceDimensionDevice::is_reset(const Library::StatusValues& status) const noexcept {
  const Library& dhd = *library_;
  const bool says = is_robot_ && dhd.is_initialized != nullptr;
  return says ? !dhd.is_initialized(id_) : status[Library::kReset] != 0;
}

/// What has to be done before its poses and forces are right; null if nothing.
const char* ForceDimensionDevice::find_unready() noexcept {
  const Library& dhd = *library_;
  Library::StatusValues status{};
  if (dhd.status(status.data(), id_) < 0) return dhd.last_error();
  if (status[Library::kPower] == 0) return "has no power: switch it on";
  return !is_reset(status)
             ? nullptr
             : "is not calibrated: calibrate it as its manual says, or let the library "
               "move it, auto-init=true";
}

std::string ForceDimensionDevice::model() const {
  const char* const name = library_->system_name(id_);
  return name != nullptr ? name : "device";
}

int ForceDimensionDevice::serial() const noexcept {
  unsigned short serial = 0;
  const bool told =
      library_->serial_number != nullptr && library_->serial_number(&serial, id_) >= 0;
  return told ? serial : 0;
}

/// Limits and watchdog, motors off. The server's own limits hold without the library's; what of the
/// rest a device has not, its library refuses.
bool ForceDimensionDevice::prepare() noexcept {
  const Library& dhd = *library_;
  if (dhd.enable_expert_mode != nullptr) dhd.enable_expert_mode();
  const double units = std::floor(options_.watchdog / kWatchdogUnit);
  has_watchdog_ =
      dhd.set_watchdog != nullptr && dhd.set_watchdog(static_cast<unsigned char>(units), id_) >= 0;
  configure_speed();
  dhd.set_max_force(ratings_.max_force, id_);
  if (ratings_.max_torque > 0) dhd.set_max_torque(ratings_.max_torque, id_);
  if (ratings_.gripper && dhd.emulate_button != nullptr) dhd.emulate_button(1, id_);
  return done(dhd.set_gravity_compensation(options_.gravity_compensation ? 1 : 0, id_)) &&
         done(dhd.enable_force(0, id_));
}

/// What the library says of the handle where it is now; the model's row where it does not.
void ForceDimensionDevice::read_inertia() noexcept {
  const Library& dhd = *library_;
  if (dhd.joint_angles == nullptr || dhd.inertia_matrix == nullptr) return;
  std::array<double, 2 * Library::kJoints> angles{};
  double inertia[6][6] = {};
  if (dhd.joint_angles(angles.data(), id_) < 0) return;
  if (dhd.inertia_matrix(angles.data(), inertia, id_) < 0) return;
  const double mass = (inertia[0][0] + inertia[1][1] + inertia[2][2]) / 3;
  const double turning = (inertia[3][3] + inertia[4][4] + inertia[5][5]) / 3;
  if (kMasses.contains(mass)) ratings_.mass = mass;
  if (has_wrist_ && kInertias.contains(turning)) ratings_.inertia = turning;
}

/// A library that will not is taken as it is, and so is the vendor's own window.
void ForceDimensionDevice::configure_speed() noexcept {
  const Library& dhd = *library_;
  const int window = static_cast<int>(std::lround(1e3 * options_.velocity_window));
  const auto configured = [&](auto* configure) {
    return configure != nullptr && configure(window, Library::kMeanOverWindow, id_) >= 0;
  };
  window_ = kVendorsWindow;
  if (options_.velocity_window == kVendorsWindow) return;
  if (configured(dhd.config_linear_velocity)) window_ = options_.velocity_window;
  if (has_wrist_) configured(dhd.config_angular_velocity);
}

bool ForceDimensionDevice::reopen() {
  close();
  try {
    open();
  } catch (const std::runtime_error&) {
    refused_ = "";
    return false;
  }
  const char* const why = prepare_again();
  if (why != nullptr) close();
  refused_ = why != nullptr ? why : "";
  return why == nullptr;
}

/// Null if the device is what its ratings say, which stay as they are; otherwise why not.
const char* ForceDimensionDevice::prepare_again() {
  if (name_ != "Force Dimension " + model() || serial_ != serial()) {
    return "another device is in its place: connect the first one, or restart the server";
  }
  if (!prepare()) return "it cannot be prepared again";
  const bool had_watchdog = std::isfinite(ratings_.time_guard);
  if (had_watchdog && !has_watchdog_) return "its watchdog cannot be set as before";
  return find_unready();
}

bool ForceDimensionDevice::done(int result) noexcept {
  return result >= 0 || fail(library_->last_error());
}

bool ForceDimensionDevice::fail(const char* cause) noexcept {
  if (!failed_)
    cause_ = cause != nullptr && *cause != '\0' ? cause : "its library reports an error";
  failed_ = true;
  return false;
}

void ForceDimensionDevice::enable() noexcept {
  if (!reopener_->is_there()) return;
  failed_ = false;
  saturated_ = false;
  health_ = DeviceHealth::kGood;
  cause_ = "";
  ticks_ = 0;
  motion_.begin(window_);
  speed_.begin();
  grip_ = 0;
  read_pose(p_, R_);  // For a time guard that holds back the first one.
  const Library& dhd = *library_;
  dhd.set_brakes(0, id_);  // A device without brakes refuses.
  enabled_ = done(dhd.enable_force(1, id_)) && write(Wrench::Zero());
}

void ForceDimensionDevice::disable() noexcept {
  enabled_ = false;
  if (!reopener_->is_there()) return;
  library_->enable_force(0, id_);
  if (failed_) reopener_->lose();
}

std::optional<DeviceState> ForceDimensionDevice::read() noexcept {
  if (!reopener_->is_there() || failed_) return std::nullopt;
  DeviceState state;
  if (!read_motion(state) || !observe_status()) return std::nullopt;
  state.buttons = library_->button_mask(id_);
  read_gripper(state);
  ++ticks_;
  state.health = health_;
  if (health_ == DeviceHealth::kGood && saturated_) {
    state.health = DeviceHealth::kSaturated;
    cause_ = "more was commanded than they can give";
  }
  return state;
}

/// A device without a wrist is asked for its position alone. What a time guard holds back stays as
/// it was.
int ForceDimensionDevice::read_pose(Vector3& p, Matrix3& R) noexcept {
  const Library& dhd = *library_;
  if (!has_wrist_) return dhd.position(&p.x(), &p.y(), &p.z(), id_);
  double rows[3][3];
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> matrix(&rows[0][0]);
  matrix = R;
  const int result = dhd.pose(&p.x(), &p.y(), &p.z(), rows, id_);
  R = matrix;
  return result;
}

bool ForceDimensionDevice::read_motion(DeviceState& state) noexcept {
  const int result = read_pose(p_, R_);
  if (!done(result)) return false;
  const double now = seconds_now();
  state.X_WD = {p_, Quaternion(R_).normalized()};
  const double lag = cutoff_ > 0 ? 1 / (2 * std::numbers::pi * cutoff_) : window_ / 2;
  const Twist own = speed_.filtered(state.X_WD, now, lag);
  const Twist told = read_speed(own);
  state.V_WD = cutoff_ > 0 ? own : told;
  const bool is_old = result == Library::kTimeGuard;
  const char* const error = motion_.find_error(now, p_, R_, told, is_old);
  return error == nullptr || fail(error);
}

/// The library's, or that of the poses where it has none: its getters fail until two positions fell
/// into their window.
Twist ForceDimensionDevice::read_speed(const Twist& own) noexcept {
  const Library& dhd = *library_;
  Vector3 v = own.head<3>();
  Vector3 w = own.tail<3>();
  const bool moves = dhd.linear_velocity(&v.x(), &v.y(), &v.z(), id_) >= 0;
  const bool turns = has_wrist_ && dhd.angular_velocity(&w.x(), &w.y(), &w.z(), id_) >= 0;
  Twist V = own;
  if (moves) V.head<3>() = v;
  if (turns) V.tail<3>() = w;
  return V;
}

/// Angles of left hands are negative. A gripper that cannot be read is as if there were none.
void ForceDimensionDevice::read_gripper(DeviceState& state) noexcept {
  if (!ratings_.gripper) return;
  double angle = 0;
  if (library_->gripper_angle(&angle, id_) < 0 || !std::isfinite(angle)) return;
  const double range = model_->gripper_range > 0 ? model_->gripper_range
                                                 : kForceDimensionModels.back().gripper_range;
  state.gripper = std::clamp(std::abs(angle) / range, 0.0, 1.0);
}

void ForceDimensionDevice::grip(double force) noexcept {
  const double most = ratings_.max_gripper_force;
  grip_ = std::isfinite(force) ? std::clamp(force, -most, most) : 0;
}

/// Every few ticks.
bool ForceDimensionDevice::observe_status() noexcept {
  const auto every = static_cast<std::uint64_t>(std::ceil(kStatusPeriod / dt_));
  if (ticks_ % every != 0 || static_cast<double>(ticks_) * dt_ < kStatusPatience) return true;
  Library::StatusValues status{};
  if (!done(library_->status(status.data(), id_))) return false;
  const double rate = 1e3 * library_->communication_rate(id_);
  health_ = DeviceHealth::kGood;
  if (enabled_ && status[Library::kForceOn] == 0) {
    health_ = DeviceHealth::kForceOff;
    cause_ = cause_of_force_off(status[Library::kForceOffCause]);
    if (status[Library::kPower] == 0) cause_ = "its power is off";
    if (is_reset(status)) cause_ = "it is not calibrated any more: calibrate it";
  } else if (rate > 0 && rate < 0.5 / dt_) {
    health_ = DeviceHealth::kLate;
    cause_ = "its library exchanges with it at less than half the server's rate";
  }
  return true;
}

bool ForceDimensionDevice::write(const Wrench& F) noexcept {
  if (!reopener_->is_there()) return false;
  if (!F.allFinite()) return fail("it was commanded a wrench that is not finite");
  const int result = library_->set_wrench(F[0], F[1], F[2], F[3], F[4], F[5], grip_, id_);
  saturated_ = result == Library::kMotorSaturated;
  return done(result) && !failed_;
}

}  // namespace hlm::server
