#include "hlm/haptic_server/device/simulated_driver.h"

#include "hlm/haptic_server/device/hand_script.h"

namespace hlm::server {

void declare(SimulatedDeviceOptions& options, settings::Table& table) {
  table.choice("freedom", options.freedom, "How the handle moves");
  table.numbers(options, kSimulatedDeviceNumbers);
  table.whole("delay", options.delay, kDeviceDelays, "Delay of a command");
  table.yes_no("measures-hand", options.measures_hand_wrench,
               "Whether it measures the hand's wrench");
  table.yes_no("switched-on", options.switched_on,
               "Whether its enable switch is closed; open, its motors stay off");
  table.text(
      "amplifier", options.amplifier, "FILE",
      "File that holds what its motors are given, 6 doubles, and holds it when the server is "
      "gone; '' is none");
}

SimulatedDriver::SimulatedDriver() {
  table_.file("hand", hand_, "Hand script, TOML; '' is no hand");
  declare(options_, table_);
}

std::unique_ptr<Device> SimulatedDriver::open(double dt) const {
  HandScript hand;
  try {
    if (!hand_.empty()) hand = read_hand_script(hand_);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(error.what());
  }
  return std::make_unique<SimulatedDevice>(options_, std::move(hand), dt);
}

}  // namespace hlm::server
