// Devices of OpenHaptics as ones to be opened.
#pragma once

#include "hlm/device/device_driver.h"
#include "hlm/device/open_haptics_device.h"

namespace hlm::server {

class OpenHapticsDriver final : public DeviceDriver {
 public:
  OpenHapticsDriver();

  std::string_view name() const override { return "openhaptics"; }
  std::string_view purpose() const override {
    return "Touch and Phantom of 3D Systems, through OpenHaptics (libHD.so)";
  }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::optional<std::string> find_error() const override;
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  OpenHapticsOptions options_;
  settings::Table table_;
};

}  // namespace hlm::server
