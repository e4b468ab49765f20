// How a kind of haptic device is found and opened. Nothing here is called from the servo thread.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hlm/device/device.h"
#include "hlm/device/device_model.h"
#include "hlm/settings/table.h"

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

/// All drivers of this program, in the order in which a person reads them.
std::vector<std::unique_ptr<DeviceDriver>> all_drivers();

}  // namespace hlm::server
