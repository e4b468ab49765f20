// A device with what a person knows of its handle, and an observer of the hand that it cannot
// measure.
#pragma once

#include <memory>
#include <optional>

#include "hlm/common/settings/table.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/hand_observer.h"

namespace hlm::server {

/// Keys that every [device] table has; what is unset is as the device rates it.
struct ObserverOptions {
  bool on = true;  ///< Where the device does not measure the hand's wrench and a mass is known.
  double bandwidth = 50;            ///< Hz.
  std::optional<double> mass{};     ///< Apparent at the handle, kg.
  std::optional<double> inertia{};  ///< kg·m².
  std::optional<double> damping{};  ///< N·s/m.
  std::optional<double> delay{};    ///< Delay from a command to its effect in the pose read, s.
  std::optional<double> velocity_lag{};  ///< Of the twist behind the pose, s.

  bool operator==(const ObserverOptions&) const = default;
};

/// Declares the keys, bound to `options`.
void add_keys(settings::Table& table, ObserverOptions& options);

/// Rates what `options` say. Fills DeviceState::F_hand where the raw device does not, a mass is
/// known and `options` has the observer on. The rest is the raw device's.
class ObservedDevice final : public Device {
 public:
  /// dt: servo period, s.
  ObservedDevice(std::unique_ptr<Device> raw, const ObserverOptions& options, double dt);

  std::string_view name() const noexcept override { return raw_->name(); }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override {
    return observer_.has_value() || raw_->measures_hand_wrench();
  }
  bool observes_hand_wrench() const noexcept override { return observer_.has_value(); }
  void calibrate() override { raw_->calibrate(); }
  void align(const Pose& X_WH) noexcept override;
  void enable() noexcept override;
  void disable() noexcept override;
  GuidedHand* guided_hand() noexcept override { return raw_->guided_hand(); }
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  void grip(double force) noexcept override { raw_->grip(force); }
  const char* cause() const noexcept override { return raw_->cause(); }
  void halt() noexcept override { raw_->halt(); }

 private:
  std::unique_ptr<Device> raw_;
  DeviceRatings ratings_;
  std::optional<HandObserver> observer_;
  bool begins_ = true;  ///< The next pose is the first.
};

/// The device as an ObservedDevice.
std::unique_ptr<Device> with_hand_observer(std::unique_ptr<Device> device,
                                           const ObserverOptions& options, double dt);

}  // namespace hlm::server
