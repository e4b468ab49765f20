// Haply's Inverse3 and Minverse, through the Inverse Service.
#pragma once

#include "hlm/device/device_driver.h"
#include "hlm/device/inverse_service.h"

namespace hlm::server {

class HaplyDriver final : public DeviceDriver {
 public:
  HaplyDriver();

  std::string_view name() const override { return "haply"; }
  std::string_view purpose() const override {
    return "Haply Inverse3 or Minverse, through the Inverse Service";
  }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::optional<std::string> find_error() const override;
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  InverseServiceOptions service_;
  ExchangeOptions exchange_;
  /// Cautious, for any model; the data sheet of one's own says more.
  DeviceRatings ratings_{.max_force = 5, .max_torque = 0, .max_stiffness = 1500};
  settings::Table table_;
};

}  // namespace hlm::server
