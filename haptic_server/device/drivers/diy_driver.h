// Haply's 2DIY, a planar pantograph at a serial port.
#pragma once

#include "hlm/device/device_driver.h"
#include "hlm/device/diy_board.h"

namespace hlm::server {

class DiyDriver final : public DeviceDriver {
 public:
  DiyDriver();

  std::string_view name() const override { return "haply2diy"; }
  std::string_view purpose() const override { return "Haply 2DIY, a pantograph at a serial port"; }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::optional<std::string> find_error() const override;
  /// Serial ports, whatever is at them: a board does not say what it is.
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  DiyBoardOptions board_;
  ExchangeOptions exchange_{.rate = 1000};
  /// What two small motors give anywhere in the middle of the workspace; cautious.
  DeviceRatings ratings_{.max_force = 1.6, .max_torque = 0, .max_stiffness = 500};
  settings::Table table_;
};

}  // namespace hlm::server
