#include "hlm/devices/stand_ins/stand_in.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include "hlm/haptic_server/device/hand_script.h"

namespace hlm::stand_in {
namespace {

using namespace std::chrono_literals;
using server::DeviceState;

constexpr auto kStep = 250us;
constexpr double kStepTime = 0.25e-3;  // s.
constexpr auto kWakeUp = 1ms;
/// A machine that stood still for longer is not made up for.
constexpr auto kLongestGap = 100ms;
/// Steps between two states of kSlow.
constexpr std::uint64_t kSlowSteps = 5ms / kStep;
/// Age of a state of kLate.
constexpr std::uint64_t kLateSteps = 30ms / kStep;
/// Offset of a position of kJump, m.
constexpr double kFarJump = 0.05;
/// Offset of a position of kNoisy, m.
constexpr double kNoise = 0.5e-3;

std::string variable(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

server::HandScript hand_of_environment() {
  const std::string file = variable("HAPTIC_STAND_IN_HAND");
  return file.empty() ? server::HandScript{} : server::read_hand_script(file);
}

server::SimulatedDeviceOptions with_motors(server::SimulatedDeviceOptions options) {
  options.amplifier = variable("HAPTIC_STAND_IN_MOTORS");
  options.measures_hand_wrench = false;
  return options;
}

/// -1 if no orders are to come.
int open_orders() {
  const std::string file = variable("HAPTIC_STAND_IN_ORDERS");
  if (file.empty()) return -1;
  // Opened for writing too, a FIFO has no end.
  const int descriptor = open(file.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor >= 0) return descriptor;
  throw std::runtime_error(file + " (HAPTIC_STAND_IN_ORDERS) cannot be opened: " +
                           std::generic_category().message(errno));
}

std::uint64_t steps_in(double time) {
  return static_cast<std::uint64_t>(std::lround(time / kStepTime));
}

constexpr std::uint32_t bit_of(StandInFault fault) noexcept {
  return 1u << static_cast<unsigned>(fault);
}

}  // namespace

void run_as_hardware() {
  const sched_param lowest{.sched_priority = 1};
  sched_setscheduler(0, SCHED_FIFO, &lowest);
}

StandIn::StandIn(const server::SimulatedDeviceOptions& options, const Encoders& encoders)
    : device_(with_motors(options), hand_of_environment(), kStepTime),
      orders_(open_orders()),
      cutoff_(encoders.cutoff),
      step_(encoders.step),
      linear_window_(steps_in(encoders.window)),
      angular_window_(linear_window_),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

StandIn::~StandIn() {
  thread_.request_stop();
  thread_.join();
  device_.disable();
  if (orders_ >= 0) close(orders_);
}

void StandIn::run(const std::stop_token& stop) {
  run_as_hardware();
  while (!stop.stop_requested()) {
    read_orders();
    {
      const std::lock_guard lock(mutex_);
      advance();
    }
    std::this_thread::sleep_for(kWakeUp);
  }
}

DeviceState StandIn::state() {
  const std::lock_guard lock(mutex_);
  advance();
  if (has(StandInFault::kFreeze)) return shown_;
  std::uint64_t seen = steps_;
  if (has(StandInFault::kSlow)) seen -= seen % kSlowSteps;
  if (has(StandInFault::kLate)) seen -= std::min(seen, kLateSteps);
  shown_ = history_[seen % kHistory];
  shown_.buttons = buttons_;
  if (has(StandInFault::kNoisy)) {
    std::uniform_real_distribution<double> off(-kNoise, kNoise);
    for (double& x : shown_.X_WD.p) x += off(noise_);
  }
  if (has(StandInFault::kScaled)) {
    shown_.X_WD.p *= 1.5;
    shown_.V_WD.head<3>() *= 1.5;
  }
  if (has(StandInFault::kFast)) shown_.V_WD.head<3>() *= 2;
  if (has(StandInFault::kJump)) shown_.X_WD.p.y() -= kFarJump;
  if (has(StandInFault::kReflect)) {
    shown_.X_WD.p.x() *= -1;
    shown_.V_WD[0] *= -1;
  }
  return shown_;
}

void StandIn::command(const Wrench& F) {
  const std::lock_guard lock(mutex_);
  advance();
  command_ = F;
  commanded_ = Clock::now();
}

void StandIn::enable() {
  const std::lock_guard lock(mutex_);
  advance();
  begin();
  enabled_ = true;
  bitten_ = false;
  command_.setZero();
  commanded_ = Clock::now();
  device_.enable();
}

/// Lets the handle move from now on.
void StandIn::begin() {
  if (!has_begun_) device_.align(device_.read()->X_WD);
  has_begun_ = true;
}

void StandIn::disable() {
  const std::lock_guard lock(mutex_);
  advance();
  take_off();
}

void StandIn::set_watchdog(double time) {
  const std::lock_guard lock(mutex_);
  watchdog_ = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(time));
  commanded_ = Clock::now();
}

bool StandIn::enabled() {
  const std::lock_guard lock(mutex_);
  return enabled_;
}

bool StandIn::watchdog_has_bitten() {
  const std::lock_guard lock(mutex_);
  return bitten_;
}

void StandIn::take_off() {
  enabled_ = false;
  command_.setZero();
  device_.disable();
}

/// Up to now.
void StandIn::advance() {
  const Clock::time_point now = Clock::now();
  now_ = std::max(now_, now - kLongestGap);
  for (; now_ + kStep <= now; now_ += kStep) step();
}

void StandIn::step() {
  const bool bites = watchdog_ > Clock::duration(0) && now_ - commanded_ > watchdog_;
  if (enabled_ && bites) bitten_ = true;
  const bool is_off = bites || has(StandInFault::kUnplug) || has(StandInFault::kForceOff);
  if (enabled_ && is_off) take_off();
  Wrench F = has(StandInFault::kReverse) ? Wrench(-command_) : command_;
  if (has(StandInFault::kWeak)) F *= 0.5;
  if (has(StandInFault::kStrong)) F *= 3;
  if (has(StandInFault::kOneWeak)) F[0] *= 0.3;
  if (has_begun_ && !device_.write(F)) take_off();
  ++steps_;
  history_[steps_ % kHistory] = encoded(handle());
}

/// Where a stop holds it, or where its motors and the hand have it.
DeviceState StandIn::handle() {
  DeviceState state = *device_.read();
  if (!has(StandInFault::kStop)) {
    stopped_.reset();
    return state;
  }
  if (!stopped_) stopped_ = state.X_WD;
  state.X_WD = *stopped_;
  state.V_WD.setZero();
  return state;
}

DeviceState StandIn::encoded(DeviceState state) const {
  if (step_ > 0) state.X_WD.p = (step_ * (state.X_WD.p / step_).array().round()).matrix();
  const auto before = [this](std::uint64_t steps) -> const DeviceState& {
    return history_[(steps_ - std::min(steps, steps_)) % kHistory];
  };
  const auto time = [](std::uint64_t steps) { return static_cast<double>(steps) * kStepTime; };
  if (cutoff_ > 0) {
    const double gain = -std::expm1(-2 * std::numbers::pi * cutoff_ * kStepTime);
    const Vector3 v = (state.X_WD.p - before(1).X_WD.p) / kStepTime;
    const Vector3 latest = before(1).V_WD.head<3>();
    state.V_WD.head<3>() = latest + gain * (v - latest);
  } else if (linear_window_ > 0) {
    state.V_WD.head<3>() = (state.X_WD.p - before(linear_window_).X_WD.p) / time(linear_window_);
  }
  if (angular_window_ > 0) {
    const Quaternion R = state.X_WD.R * before(angular_window_).X_WD.R.conjugate();
    state.V_WD.tail<3>() = rotation_vector(R) / time(angular_window_);
  }
  return state;
}

void StandIn::set_window(double window, bool translations, bool rotations) {
  const std::lock_guard lock(mutex_);
  if (translations) linear_window_ = steps_in(window);
  if (rotations) angular_window_ = steps_in(window);
}

void StandIn::read_orders() {
  if (orders_ < 0) return;
  std::array<char, 256> bytes;
  const ssize_t count = read(orders_, bytes.data(), bytes.size());
  if (count <= 0) return;
  pending_.append(bytes.data(), static_cast<std::size_t>(count));
  for (std::size_t end; (end = pending_.find('\n')) != std::string::npos;) {
    obey(std::string_view(pending_).substr(0, end));
    pending_.erase(0, end + 1);
  }
}

void StandIn::obey(std::string_view order) {
  const std::lock_guard lock(mutex_);
  if (order == "good") {
    faults_ = 0;
  } else if (order == "let_go") {
    device_.guided_hand()->release();
  } else if (order.starts_with("hold ")) {
    hold(order.substr(order.find(' ')));
  } else if (order == "replug") {
    faults_ &= ~bit_of(StandInFault::kUnplug);
  } else if (const auto fault = value_of<StandInFault>(order)) {
    faults_ |= bit_of(*fault);
  } else if (const std::size_t space = order.find(' '); space != std::string_view::npos) {
    unsigned button = 0;
    std::from_chars(order.data() + space + 1, order.data() + order.size(), button);
    const std::uint32_t mask = 1u << (button % 32);
    if (order.starts_with("press ")) buttons_ |= mask;
    if (order.starts_with("release ")) buttons_ &= ~mask;
  }
}

void StandIn::hold(std::string_view place) {
  std::istringstream text{std::string(place)};
  Vector3 p;
  if (!(text >> p.x() >> p.y() >> p.z())) return;
  begin();
  device_.guided_hand()->hold({p, device_.read()->X_WD.R});
}

}  // namespace hlm::stand_in
