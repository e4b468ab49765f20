// A recorded device as one to be opened.
#pragma once

#include <string>

#include "hlm/device/device_driver.h"

namespace hlm::server {

/// Plays the device of a tick log. A log does not say what its device was rated for, so the keys
/// do, under the names that the simulated device has for them.
class ReplayDriver final : public DeviceDriver {
 public:
  ReplayDriver();

  std::string_view name() const override { return "replay"; }
  std::string_view purpose() const override { return "the device of a recorded tick log"; }
  const settings::Table& table() const override { return table_; }
  PoseFrame pose_frame() const override { return PoseFrame::kRecorded; }
  std::optional<std::string> find_error() const override;
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  std::string log_;
  DeviceRatings ratings_;  ///< As the simulated device has them, unless said otherwise.
  settings::Table table_;
};

}  // namespace hlm::server
