// Which device the user wants: the configuration's [device] table.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hlm/common/settings/command_line.h"
#include "hlm/haptic_server/device/device_driver.h"
#include "hlm/haptic_server/device/observed_device.h"
#include "hlm/haptic_server/device/workspace.h"

namespace hlm::server {

/// The simulated device's first, then registered_drivers().
std::vector<std::unique_ptr<DeviceDriver>> all_drivers();

/// Reads `driver` first, then the keys of that driver and those of its workspace. Where the command
/// line names another driver than the file, the file's keys are kept as far as both drivers have
/// them.
class DeviceChoice final : public settings::Section {
 public:
  explicit DeviceChoice(std::vector<std::unique_ptr<DeviceDriver>> drivers = all_drivers());

  void set(const std::vector<settings::Assignment>& assignments) override;
  std::string to_toml(bool described) const override;
  /// Adds the options --device, --hand and --device-option.
  void add_to(settings::CommandLine& command_line);

  const DeviceDriver& driver() const { return *driver_; }
  /// How it lies in the world; of no effect on a recording.
  const Workspace& workspace() const { return workspace_; }
  /// All keys of the chosen device with their values. Where a file lies does not matter, what it
  /// says does.
  std::string fingerprint_text() const;
  /// Why the keys cannot be used together; empty if they can.
  std::optional<std::string> find_error() const;
  /// What --device list or --device-help asks for; empty if neither was given.
  std::optional<std::string> information() const;
  /// The chosen device, calibrated. dt: servo period, s. Throws std::runtime_error.
  std::unique_ptr<Device> open(double dt) const;

 private:
  const DeviceDriver& find(const settings::Assignment& name) const;
  const settings::Setting* find_key(const DeviceDriver& driver, const std::string& key) const;
  void set_key(const DeviceDriver& driver, const settings::Assignment& assignment) const;
  void set_listed(const std::vector<settings::Assignment>& assignments) const;

  std::vector<std::unique_ptr<DeviceDriver>> drivers_;
  const DeviceDriver* driver_;
  Workspace workspace_;
  ObserverOptions observer_;
  settings::Table workspace_table_;  ///< Keys of both.
  bool lists_ = false;
  bool helps_ = false;
};

}  // namespace hlm::server
