#include "hlm/device/force_dimension_device.h"

#include <algorithm>
#include <chrono>
#include <cmath>
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
/// A gripper's angle when it is open, rad.
constexpr double kOpenGripper = 0.5;
/// Buttons of the mask that the library gives.
constexpr std::uint8_t kButtons = 16;
struct Rated {
  std::string_view family;
  double force;              ///< N.
  double torque;             ///< N·m.
  double stiffness;          ///< N/m.
  double angular_stiffness;  ///< N·m/rad.
};

/// What is not rated there is that of the last row.
constexpr std::array<Rated, 4> kRated{{
    {"omega", 12, 0.1, 5000, 0.5},
    {"sigma", 12, 0.2, 4000, 1},
    {"lambda", 5, 0.1, 8000, 0.5},
    {"", 5, 0.1, 2000, 0.5},
}};

double seconds_now() noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

DeviceRatings force_dimension_ratings(std::string_view name, bool torque) noexcept {
  const Rated* rated = kRated.data();
  while (name.find(rated->family) == std::string_view::npos) ++rated;
  DeviceRatings ratings;
  ratings.max_force = rated->force;
  ratings.max_torque = torque ? rated->torque : 0;
  ratings.max_stiffness = rated->stiffness;
  ratings.max_angular_stiffness = rated->angular_stiffness;
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
  ratings_ = force_dimension_ratings(name_, active_wrist);
  ratings_.freedoms = has_wrist_ ? kAllFreedoms : Freedoms{0b000111};
  ratings_.buttons = kButtons;
  ratings_.gripper = dhd.has_gripper(id_);
  is_left_handed_ = dhd.is_left_handed != nullptr && dhd.is_left_handed(id_);
  if (!prepare()) {
    const std::string why = cause_;
    close();
    throw std::runtime_error(name_ + " cannot be prepared: " + why);
  }
  if (has_watchdog_) ratings_.time_guard = options_.watchdog;
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

void ForceDimensionDevice::open() {
  const Library& dhd = *library_;
  is_robot_ = options_.auto_init && dhd.robot_open_id != nullptr && dhd.robot_close != nullptr;
  const auto open_number = is_robot_ ? dhd.robot_open_id : dhd.open_id;
  const int id = options_.serial > 0 ? dhd.open_serial(options_.serial)
                                     : open_number(static_cast<char>(options_.number));
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
  if (dhd.auto_init(id_) < 0 || dhd.robot_stop(true, id_) < 0) {
    throw std::runtime_error(name_ + " could not be calibrated: " + dhd.last_error());
  }
  dhd.enable_force(0, id_);
}

/// libdrd.so says it; without that the status does.
bool ForceDimensionDevice::is_reset(const Library::StatusValues& status) const noexcept {
  const Library& dhd = *library_;
  return dhd.is_initialized != nullptr ? !dhd.is_initialized(id_) : status[Library::kReset] != 0;
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

/// Limits and watchdog, motors off.
bool ForceDimensionDevice::prepare() noexcept {
  const Library& dhd = *library_;
  if (dhd.enable_expert_mode != nullptr) dhd.enable_expert_mode();
  const double units = std::floor(options_.watchdog / kWatchdogUnit);
  has_watchdog_ =
      dhd.set_watchdog != nullptr && dhd.set_watchdog(static_cast<unsigned char>(units), id_) >= 0;
  configure_speed();
  return done(dhd.set_max_force(ratings_.max_force, id_)) &&
         (ratings_.max_torque == 0 || done(dhd.set_max_torque(ratings_.max_torque, id_))) &&
         done(dhd.set_gravity_compensation(options_.gravity_compensation ? 1 : 0, id_)) &&
         done(dhd.enable_force(0, id_));
}

/// A library that will not is taken as it is.
void ForceDimensionDevice::configure_speed() noexcept {
  const Library& dhd = *library_;
  const int window = static_cast<int>(std::lround(1e3 * options_.velocity_window));
  const auto configured = [&](auto* configure) {
    return configure != nullptr && configure(window, Library::kMeanOverWindow, id_) >= 0;
  };
  window_ = configured(dhd.config_linear_velocity) ? options_.velocity_window : kVendorsWindow;
  ratings_.velocity_lag = window_ / 2;
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
  const Library& dhd = *library_;
  enabled_ =
      done(dhd.set_brakes(0, id_)) && done(dhd.enable_force(1, id_)) && write(Wrench::Zero());
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
  if (!read_motion(state) || !read_buttons(state) || !observe_status()) return std::nullopt;
  ++ticks_;
  state.health = health_;
  if (health_ == DeviceHealth::kGood && saturated_) {
    state.health = DeviceHealth::kSaturated;
    cause_ = "more was commanded than they can give";
  }
  return state;
}

bool ForceDimensionDevice::read_motion(DeviceState& state) noexcept {
  const Library& dhd = *library_;
  Vector3 p;
  double rows[3][3];
  Vector3 v = Vector3::Zero();
  Vector3 w = Vector3::Zero();
  const int result = dhd.pose(&p.x(), &p.y(), &p.z(), rows, id_);
  if (!done(result) || !done(dhd.linear_velocity(&v.x(), &v.y(), &v.z(), id_))) return false;
  if (has_wrist_ && !done(dhd.angular_velocity(&w.x(), &w.y(), &w.z(), id_))) return false;
  Matrix3 R = Matrix3::Identity();
  if (has_wrist_) R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&rows[0][0]);
  state.V_WD << v, w;
  const bool is_old = result == Library::kTimeGuard;
  if (const char* error = motion_.find_error(seconds_now(), p, R, state.V_WD, is_old)) {
    return fail(error);
  }
  state.X_WD = {p, Quaternion(R).normalized()};
  return true;
}

bool ForceDimensionDevice::read_buttons(DeviceState& state) noexcept {
  state.buttons = library_->button_mask(id_);
  if (!ratings_.gripper) return true;
  double angle = 0;
  if (!done(library_->gripper_angle(&angle, id_))) return false;
  if (!std::isfinite(angle)) return fail("its gripper's angle is not a number");
  if (is_left_handed_) angle = -angle;
  state.gripper = std::clamp(angle / kOpenGripper, 0.0, 1.0);
  return true;
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
  const int result = library_->set_wrench(F[0], F[1], F[2], F[3], F[4], F[5], 0, id_);
  saturated_ = result == Library::kMotorSaturated;
  return done(result) && !failed_;
}

}  // namespace hlm::server
