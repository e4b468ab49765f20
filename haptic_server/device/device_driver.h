// How a kind of haptic device is found and opened. Nothing here is called from the servo thread.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hlm/common/settings/table.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/device_model.h"

namespace hlm::server {

/// What the poses of a driver's devices are relative to.
enum class PoseFrame {
  kDevice,  ///< The device's own frame, in metres of the handle; align() moves nothing.
  kWorld,   ///< The world, where align() puts the handle.
};

/// One kind of device. What its library or service needs is opened by connected() and open(), so a
/// driver costs nothing, and lacks nothing, until it is asked.
class DeviceDriver {
 public:
  virtual ~DeviceDriver() = default;

  /// What --device and the configuration call it.
  virtual std::string_view name() const = 0;
  /// One clause for a person.
  virtual std::string_view purpose() const = 0;
  /// The driver's own keys of the configuration's [device] table; those of a Workspace are for all.
  virtual const settings::Table& table() const = 0;
  /// Pose frame of the devices that open() gives.
  virtual PoseFrame pose_frame() const { return PoseFrame::kDevice; }
  /// Why the keys cannot be used together; empty if they can.
  virtual std::optional<std::string> find_error() const { return std::nullopt; }

  /// The rows of its table of models, each rated with the keys as they are; empty: it has none.
  virtual std::vector<RatedModel> models() const { return {}; }

  /// The devices that open() could open now, one line each: which, and how it was reached. Throws
  /// std::runtime_error that says what is missing, where it was searched and where to get it.
  virtual std::vector<std::string> connected() const = 0;
  /// Opens the device that the keys describe, motors off; not yet calibrated. dt: servo period, s.
  /// Throws std::runtime_error, or settings::UsageError where a key is at fault.
  virtual std::unique_ptr<Device> open(double dt) const = 0;
};

/// A vendor's driver registers itself in the programs that are linked with it: one of these, in its
/// source, at namespace scope.
class DriverRegistration {
 public:
  using Make = std::unique_ptr<DeviceDriver> (*)();
  explicit DriverRegistration(Make make) noexcept;

 private:
  friend std::vector<std::unique_ptr<DeviceDriver>> registered_drivers();

  Make make_;
  const DriverRegistration* next_;
};

/// The registration of a driver of this class.
template <class Driver>
struct RegistrationOf : DriverRegistration {
  RegistrationOf() noexcept
      : DriverRegistration(
            []() -> std::unique_ptr<DeviceDriver> { return std::make_unique<Driver>(); }) {}
};

/// Those of vendors that this program is linked with, by name.
std::vector<std::unique_ptr<DeviceDriver>> registered_drivers();

}  // namespace hlm::server
