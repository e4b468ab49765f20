#include "hlm/haptic_server/loop/port.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hlm/haptic_server/safety/model_energy.h"

namespace hlm::server {
namespace {

constexpr const char* kWarm = "motors get warm: they give their continuous force until they cool";
constexpr const char* kNotFinite = "a number of its state is not finite";

bool is_finite(const DeviceState& device) noexcept {
  return device.X_WD.p.allFinite() && device.X_WD.R.coeffs().allFinite() &&
         device.V_WD.allFinite() && std::isfinite(device.gripper.value_or(0)) &&
         (!device.F_hand || device.F_hand->allFinite());
}

void describe(const DeviceState& device, Device& of, TickRecord& record) noexcept {
  record.X_WD = device.X_WD;
  record.V_WD = device.V_WD;
  record.hand_measured = device.F_hand.has_value();
  record.hand_observed = device.hand_observed;
  record.F_hand = device.F_hand.value_or(Wrench::Zero());
  record.buttons = device.buttons;
  record.gripper = device.gripper.value_or(0);
  record.scale = of.ratings().scale;
  record.health = device.health;
  if (device.health != DeviceHealth::kGood) record.cause = of.cause();
}

}  // namespace

Port::Port(const ServoOptions& options, Device& device) noexcept
    : device_(device),
      limiter_(options.limits, device.ratings(), 1 / options.rate),
      energy_(device.ratings(), limiter_.budget().energy.capacity, 1 / options.rate),
      handle_(options.handle),
      grip_(limiter_.budget(), device.ratings(), 1 / options.rate) {}

void Port::begin(const Pose& X_WH) noexcept {
  device_.align(X_WH);
  device_.enable();
  limiter_.restart();
  energy_.begin();
  grip_.begin();
  halted_ = false;
  clutched_ = false;
}

void Port::allow(bool force) noexcept { limiter_.allow(force && !clutched_); }

void Port::grip(double force) noexcept {
  if (ratings().max_gripper_force > 0) device_.grip(grip_.limit(force, limiter_.portion()));
}

/// No force, which then rises from none.
void Port::drop() noexcept {
  limiter_.cut();
  grip_.drop();
  device_.grip(0);
}

void Port::cut() noexcept {
  drop();
  device_.write(Wrench::Zero());
  device_.disable();
}

const DeviceState* Port::read(bool first, TickRecord& record) noexcept {
  cause_ = nullptr;
  exchange_ = {.read = true, .state = device_.read()};
  if (!exchange_.state) return nullptr;
  const DeviceState& device = *exchange_.state;
  if (!is_finite(device)) {
    cause_ = kNotFinite;
    return nullptr;
  }
  clutched_ = device.clutched;
  if (first || clutched_) X_WStart_ = device.X_WD;
  describe(device, device_, record);
  limiter_.warm(device.warm);
  if (limiter_.cools() && device.health == DeviceHealth::kGood) {
    record.health = DeviceHealth::kSaturated;
    record.cause = kWarm;
  }
  return &device;
}

Fault Port::observe(const DeviceState& device, TickRecord& record) noexcept {
  const Fault beyond = handle_.exceeded(X_WStart_, device.X_WD, device.V_WD, ratings().scale,
                                        ratings().rotation_scale);
  // For how long of a stall the motors were on is not known: only what they may have given counts.
  grip_.observe(device.gripper, halted_);
  if (halted_ && limiter_.work_until(device.X_WD) < 0) drop();
  limiter_.observe(device.X_WD, energy_.supply());
  record.port = limiter_.ledger();
  record.port_bound = limiter_.energy_bound();
  record.port_power = limiter_.power_bound();
  energy_.observe(device.X_WD, device.V_WD, record.port);
  record.brought = energy_.brought();
  if (beyond != Fault::kNone) return beyond;
  if (limiter_.overdrawn() || grip_.overdrawn()) return Fault::kEnergy;
  // Force rises again from zero when the motors are on again.
  const bool halted = std::exchange(halted_, false);
  if (halted) device_.enable();
  if (halted || device.health == DeviceHealth::kForceOff) drop();
  return Fault::kNone;
}

void Port::explain(const LocalModel& model) noexcept {
  energy_.follow(limiter_.explained(environment_power(model)));
}

void Port::explain(const LocalModel& model, const Pose& X_WP, const Wrench& F_hand,
                   const DeviceState& device, bool twice) noexcept {
  energy_.step(model, X_WP, F_hand, device.hand_observed,
               limiter_.explained(environment_power(model)), twice);
}

Fault Port::write(const Wrench& u, const Wrench& impulse, const Wrench& weight,
                  const DeviceState& device, TickRecord& record) noexcept {
  record.F_command = limiter_.limit(u, impulse, device.V_WD, weight);
  record.limit = limiter_.limited_by();
  if (limiter_.met_non_finite()) return Fault::kNonFinite;
  exchange_.written = device_.write(record.F_command);
  return exchange_.written ? Fault::kNone : Fault::kDevice;
}

}  // namespace hlm::server
