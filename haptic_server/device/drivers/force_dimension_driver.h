// Force Dimension's devices as ones to be opened.
#pragma once

#include "hlm/device/device_driver.h"
#include "hlm/device/force_dimension_device.h"

namespace hlm::server {

class ForceDimensionDriver final : public DeviceDriver {
 public:
  ForceDimensionDriver();

  std::string_view name() const override { return "forcedimension"; }
  std::string_view purpose() const override {
    return "omega, delta, sigma and lambda of Force Dimension, through libdrd.so or libdhd.so";
  }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  ForceDimensionOptions options_;
  settings::Table table_;
};

}  // namespace hlm::server
