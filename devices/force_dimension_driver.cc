// Force Dimension's devices as ones to be opened.
#include <algorithm>

#include "hlm/devices/force_dimension_device.h"
#include "hlm/haptic_server/device/device_driver.h"

namespace hlm::server {
namespace {

/// Usual servo period, s.
constexpr double kUsualPeriod = 1e-3;

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

ForceDimensionDriver::ForceDimensionDriver() {
  table_.text("library", options_.library, "FILE",
              "The vendor's library; '' is libdrd.so or libdhd.so, as the dynamic linker finds it");
  table_.yes_no("simulator", options_.simulator,
                "Whether the vendor's simulator on this machine counts as a device");
  table_.whole("number", options_.number, kForceDimensionNumbers,
               "Which of the connected devices, from 0");
  table_.whole("serial", options_.serial, kForceDimensionSerials,
               "Which by its serial number; 0 is by 'number'");
  table_.number("watchdog", options_.watchdog, kForceDimensionWatchdogs,
                "Without a command for so long the device takes its motors off");
  table_.yes_no("auto-init", options_.auto_init,
                "Whether libdrd.so calibrates a device that is not: it moves by itself");
  table_.number("velocity-cutoff", options_.velocity_cutoff, kForceDimensionCutOffs,
                "Cut-off of the filter on the change of pose. Unset: as the model is rated; 0 is "
                "the library's own speed");
  table_.number("velocity-window", options_.velocity_window, kForceDimensionWindows,
                "The library takes its own speed as the mean over so long");
  table_.yes_no("gravity-compensation", options_.gravity_compensation,
                "Whether the device bears its own weight");
}

std::vector<RatedModel> ForceDimensionDriver::models() const {
  std::vector<RatedModel> rows;
  for (const DeviceModel& model : force_dimension_models()) {
    rows.push_back(
        {model, force_dimension_ratings(model, model.torque > 0, options_, kUsualPeriod)});
  }
  return rows;
}

std::vector<std::string> ForceDimensionDriver::connected() const {
  const ForceDimensionLibrary dhd(options_.library, options_.simulator);
  std::vector<std::string> lines;
  const int most = static_cast<int>(kForceDimensionNumbers.most) + 1;
  for (int i = 0; i < std::min(dhd.device_count(), most); ++i) {
    const std::string number = "number " + std::to_string(i) + ": ";
    const int id = dhd.open_id(static_cast<char>(i));
    if (id < 0) {
      lines.push_back(number + "cannot be opened: " + dhd.last_error());
      continue;
    }
    const char* const name = dhd.system_name(static_cast<char>(id));
    lines.push_back(number + (name != nullptr ? name : "unknown") + ", through " +
                    dhd.library.description());
    dhd.close(static_cast<char>(id));
  }
  return lines;
}

std::unique_ptr<Device> ForceDimensionDriver::open(double dt) const {
  return std::make_unique<ForceDimensionDevice>(
      std::make_shared<const ForceDimensionLibrary>(options_.library, options_.simulator), options_,
      dt);
}

const RegistrationOf<ForceDimensionDriver> force_dimension_registration;

}  // namespace
}  // namespace hlm::server
