// Devices of OpenHaptics as ones to be opened.
#include "hlm/devices/open_haptics_device.h"
#include "hlm/haptic_server/device/device_driver.h"

namespace hlm::server {
namespace {

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

OpenHapticsDriver::OpenHapticsDriver() {
  table_.text("library", options_.library, "FILE",
              "The vendor's library; '' is libHD.so, as the dynamic linker finds it");
  table_.text("unit", options_.unit, "NAME",
              "Which device, as the vendor's setup calls it; '' is 'Default Device' or 'Default "
              "PHANToM'");
  table_.number("scheduler-rate", options_.rate, kOpenHapticsRates,
                "Exchanges of the vendor's scheduler with the device");
  table_.number(
      "velocity-cutoff", options_.velocity_cutoff, kOpenHapticsCutOffs,
      "Cut-off of the filter on the change of position. Unset: as the model is rated; 0 is the "
      "library's own speed");
  table_.number("oldest", options_.oldest, kOpenHapticsAges,
                "Oldest state and oldest command that are used");
}

std::vector<RatedModel> OpenHapticsDriver::models() const {
  std::vector<RatedModel> rows;
  for (const DeviceModel& model : open_haptics_models()) {
    rows.push_back({model, open_haptics_ratings(model, options_)});
  }
  return rows;
}

std::optional<std::string> OpenHapticsDriver::find_error() const {
  for (const double rate : {500, 1000, 2000}) {
    if (options_.rate == rate) return std::nullopt;
  }
  return "scheduler-rate " + shortest_text(options_.rate) +
         " Hz must be 500, 1000 or 2000 Hz: the library takes no other";
}

/// The library does not list devices: only the one of that name can be tried.
std::vector<std::string> OpenHapticsDriver::connected() const {
  const auto library = std::make_shared<const OpenHapticsLibrary>(options_.library);
  const OpenHapticsDevice device(library, options_);
  return {"'" + device.unit() + "': " + std::string(device.name()) + ", through " +
          library->library.description()};
}

std::unique_ptr<Device> OpenHapticsDriver::open(double) const {
  return std::make_unique<OpenHapticsDevice>(
      std::make_shared<const OpenHapticsLibrary>(options_.library), options_);
}

const RegistrationOf<OpenHapticsDriver> open_haptics_registration;

}  // namespace
}  // namespace hlm::server
