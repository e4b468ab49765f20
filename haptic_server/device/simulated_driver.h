// The simulated device as one to be opened.
#pragma once

#include <string>

#include "hlm/haptic_server/device/device_driver.h"
#include "hlm/haptic_server/device/simulated_device.h"

namespace hlm::server {

/// The keys of such a device, but for the hand on it.
void declare(SimulatedDeviceOptions& options, settings::Table& table);

class SimulatedDriver final : public DeviceDriver {
 public:
  SimulatedDriver();

  std::string_view name() const override { return "simulated"; }
  std::string_view purpose() const override { return "an impedance device and the hand on it"; }
  const settings::Table& table() const override { return table_; }
  PoseFrame pose_frame() const override { return PoseFrame::kWorld; }
  std::vector<std::string> connected() const override { return {"always there"}; }
  std::unique_ptr<Device> open(double dt) const override;

 private:
  SimulatedDeviceOptions options_;
  std::string hand_;  ///< Hand script; empty: no hand.
  settings::Table table_;
};

}  // namespace hlm::server
