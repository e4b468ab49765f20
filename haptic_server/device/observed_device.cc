#include "hlm/haptic_server/device/observed_device.h"

#include <utility>

#include "hlm/haptic_server/device/saturate.h"

namespace hlm::server {
namespace {

DeviceRatings with_overrides(DeviceRatings ratings, const ObserverOptions& options) noexcept {
  ratings.mass = options.mass.value_or(ratings.mass);
  ratings.inertia = options.inertia.value_or(ratings.inertia);
  ratings.damping = options.damping.value_or(ratings.damping);
  ratings.delay = options.delay.value_or(ratings.delay);
  ratings.velocity_lag = options.velocity_lag.value_or(ratings.velocity_lag);
  return ratings;
}

}  // namespace

void add_keys(settings::Table& table, ObserverOptions& options) {
  table.group("Observer of the hand");
  table.yes_no("observe-hand", options.on,
               "Whether the hand's wrench is estimated where the device does not measure it and a "
               "mass is known");
  table.number("observer-bandwidth", options.bandwidth, {1, 250, "Hz"},
               "Bandwidth of that estimate: more follows the hand sooner, and makes more noise of "
               "encoder steps");
  table.number(
      "apparent-mass", options.mass, {0.001, 1000, "kg"},
      "Mass at the handle, for that estimate and the stiffness that the device bears. Unset: as "
      "the device rates it");
  table.number("apparent-inertia", options.inertia, {1e-6, 100, "kg·m²"},
               "Inertia at the handle, likewise");
  table.number("apparent-damping", options.damping, {0, 1e4, "N·s/m"},
               "Damping at the handle, likewise");
  table.number("apparent-delay", options.delay, {0, 0.1, "s"},
               "From a command to its effect in the pose that is read, likewise");
  table.number(
      "apparent-velocity-lag", options.velocity_lag, {0, 0.1, "s"},
      "How much later the velocity that is read is than the pose, half the window of a mean, "
      "for the stiffness that the device bears. Unset: as the device rates it");
}

ObservedDevice::ObservedDevice(std::unique_ptr<Device> raw, const ObserverOptions& options,
                               double dt)
    : raw_(std::move(raw)), ratings_(with_overrides(raw_->ratings(), options)) {
  if (options.on && !raw_->measures_hand_wrench() && ratings_.mass > 0) {
    observer_.emplace(ratings_, quiet_bandwidth(ratings_, options.bandwidth, dt), dt);
  }
}

void ObservedDevice::align(const Pose& X_WH) noexcept {
  raw_->align(X_WH);
  begins_ = true;
}

void ObservedDevice::enable() noexcept {
  raw_->enable();
  begins_ = true;
}

void ObservedDevice::disable() noexcept {
  raw_->disable();
  begins_ = true;
}

std::optional<DeviceState> ObservedDevice::read() noexcept {
  std::optional<DeviceState> state = raw_->read();
  if (!state || !observer_) return state;
  if (std::exchange(begins_, false)) observer_->restart(state->X_WD);
  state->F_hand = observer_->observe(state->X_WD, state->health != DeviceHealth::kForceOff);
  state->hand_observed = true;
  return state;
}

bool ObservedDevice::write(const Wrench& F) noexcept {
  if (observer_) observer_->command(saturated(F, ratings_.max_force, ratings_.max_torque));
  return raw_->write(F);
}

std::unique_ptr<Device> with_hand_observer(std::unique_ptr<Device> device,
                                           const ObserverOptions& options, double dt) {
  return std::make_unique<ObservedDevice>(std::move(device), options, dt);
}

}  // namespace hlm::server
