#include "hlm/haptic_server/device/device_choice.h"

#include <fstream>
#include <iterator>

#include "hlm/common/settings/nearest.h"
#include "hlm/haptic_server/device/simulated_driver.h"

namespace hlm::server {
namespace {

using settings::Assignment;
using settings::UsageError;

const std::string kDriver = "driver";
const std::string kList = "list";

std::string connected_to(const DeviceDriver& driver) {
  std::vector<std::string> lines;
  try {
    lines = driver.connected();
    if (lines.empty()) lines = {"none connected"};
  } catch (const std::runtime_error& error) {
    lines = {error.what()};
  }
  std::string text;
  for (const std::string& line : lines) text += "    " + line + '\n';
  return text;
}

std::string file_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string text_of(const settings::Table& table) {
  std::string text;
  for (const settings::Setting& setting : table.settings()) {
    text += setting.key + '=';
    for (const std::string& value : setting.get()) {
      text += (setting.is_file ? file_text(value) : value) + '\n';
    }
  }
  return text;
}

}  // namespace

std::vector<std::unique_ptr<DeviceDriver>> all_drivers() {
  std::vector<std::unique_ptr<DeviceDriver>> drivers = registered_drivers();
  drivers.insert(drivers.begin(), std::make_unique<SimulatedDriver>());
  return drivers;
}

DeviceChoice::DeviceChoice(std::vector<std::unique_ptr<DeviceDriver>> drivers)
    : drivers_(std::move(drivers)), driver_(drivers_.front().get()) {
  add_keys(workspace_table_, workspace_);
  add_keys(workspace_table_, observer_);
}

void DeviceChoice::add_to(settings::CommandLine& command_line) {
  std::string names;
  for (const auto& driver : drivers_) names += std::string(driver->name()) + ", ";
  command_line.section(
      {.name = "device",
       .group = "Device",
       .section = this,
       .option = "device-option",
       .help = "Set a key of the device, any number of times",
       .shorthands = {{"device", kDriver, "NAME",
                       "Device: " + names + "or list, which says what is connected (default " +
                           std::string(driver_->name()) + ")"},
                      {"hand", "hand", "FILE", "Hand script of the simulated device, TOML"}}});
  command_line.table().group("Device");
  command_line.table().flag("device-help", helps_, "Print the keys of the device and end");
  command_line.table().not_in_files();
}

void DeviceChoice::set(const std::vector<Assignment>& assignments) {
  const DeviceDriver* of_file = driver_;
  const DeviceDriver* chosen = nullptr;
  for (const Assignment& each : assignments) {
    if (each.key != kDriver) continue;
    const bool lists = !each.from_file && each.values == settings::Values{kList};
    lists_ = lists_ || lists;
    if (lists) continue;
    (each.from_file ? of_file : chosen) = &find(each);
  }
  driver_ = chosen != nullptr ? chosen : of_file;
  if (lists_) return set_listed(assignments);
  for (const Assignment& each : assignments) {
    if (each.key == kDriver) continue;
    const bool is_of_other = each.from_file && driver_ != of_file &&
                             find_key(*driver_, each.key) == nullptr &&
                             find_key(*of_file, each.key) != nullptr;
    if (!is_of_other) set_key(*driver_, each);
  }
}

/// A key of a list is for each driver that has it.
void DeviceChoice::set_listed(const std::vector<Assignment>& assignments) const {
  for (const Assignment& each : assignments) {
    if (each.key == kDriver) continue;
    bool is_known = each.from_file || workspace_table_.find(each.key) != nullptr;
    for (const auto& driver : drivers_) {
      if (driver->table().find(each.key) == nullptr) continue;
      if (!each.from_file || driver.get() == driver_) set_key(*driver, each);
      is_known = true;
    }
    if (!is_known) throw UsageError(each.name + ": no device has such a key");
  }
}

const DeviceDriver& DeviceChoice::find(const Assignment& name) const {
  std::string known;
  for (const auto& driver : drivers_) {
    if (name.values == settings::Values{std::string(driver->name())}) return *driver;
    known += (known.empty() ? "" : ", ") + std::string(driver->name());
  }
  throw UsageError(name.name + ' ' + (name.values.empty() ? "''" : name.values.front()) +
                   " must be one of " + known + (name.from_file ? "" : ", list"));
}

/// Null if that device has no such key.
const settings::Setting* DeviceChoice::find_key(const DeviceDriver& driver,
                                                const std::string& key) const {
  const settings::Setting* const own = driver.table().find(key);
  return own == nullptr ? workspace_table_.find(key) : own;
}

void DeviceChoice::set_key(const DeviceDriver& driver, const Assignment& assignment) const {
  const settings::Setting* const setting = find_key(driver, assignment.key);
  if (setting == nullptr) {
    std::vector<std::string> keys = driver.table().keys();
    for (const std::string& key : workspace_table_.keys()) keys.push_back(key);
    const std::string hint = settings::suggestion(assignment.key, keys);
    throw UsageError(assignment.name + ": device " + std::string(driver.name()) +
                     " has no such key" + (hint.empty() ? "; see --device-help" : hint));
  }
  settings::set(*setting, assignment);
}

std::string DeviceChoice::to_toml(bool described) const {
  return kDriver + " = \"" + std::string(driver_->name()) + "\"\n" +
         driver_->table().to_toml(described) + workspace_table_.to_toml(described);
}

std::optional<std::string> DeviceChoice::find_error() const {
  if (auto error = server::find_error(workspace_)) return error;
  return driver_->find_error();
}

std::string DeviceChoice::fingerprint_text() const {
  // Without keys of workspace and observer the text is that of servers that had none.
  const bool as_ever = workspace_ == Workspace{} && observer_ == ObserverOptions{};
  return text_of(driver_->table()) + (as_ever ? "" : text_of(workspace_table_));
}

std::optional<std::string> DeviceChoice::information() const {
  if (lists_) {
    std::string text;
    for (const auto& driver : drivers_) {
      text += settings::help_line(std::string(driver->name()), std::string(driver->purpose()));
      text += connected_to(*driver);
    }
    return text + "Keys of one: --device NAME --device-help\n";
  }
  if (!helps_) return std::nullopt;
  return "Keys of device " + std::string(driver_->name()) + ", " + std::string(driver_->purpose()) +
         ":\nin a configuration file under [device], or as --device-option KEY=VALUE\n\n" +
         settings::help_of(driver_->table(), "") + settings::help_of(workspace_table_, "");
}

std::unique_ptr<Device> DeviceChoice::open(double dt) const {
  auto device = driver_->open(dt);
  const int buttons = device->ratings().buttons;
  device = with_hand_observer(std::move(device), observer_, dt);
  const bool is_asked = workspace_ != Workspace{};
  if (is_asked && workspace_.clutch > buttons) {
    throw UsageError("clutch " + std::to_string(workspace_.clutch) + " must be one of the " +
                     std::to_string(buttons) + " buttons of " + std::string(device->name()));
  }
  if (is_asked || driver_->pose_frame() == PoseFrame::kDevice) {
    device = std::make_unique<WorkspaceDevice>(std::move(device), workspace_);
  }
  device->calibrate();
  return device;
}

}  // namespace hlm::server
