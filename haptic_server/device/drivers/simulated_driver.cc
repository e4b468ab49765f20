#include "hlm/device/drivers/simulated_driver.h"

#include "hlm/device/hand_script.h"

namespace hlm::server {

SimulatedDriver::SimulatedDriver() {
  table_.file("hand", hand_, "Hand script, TOML; '' is no hand");
  table_.choice("freedom", options_.freedom, "How the handle moves");
  table_.numbers(options_, kSimulatedDeviceNumbers);
  table_.whole("delay", options_.delay, kDeviceDelays, "Delay of a command");
  table_.yes_no("measures-hand", options_.measures_hand_wrench,
                "Whether it measures the hand's wrench");
  table_.yes_no("switched-on", options_.switched_on,
                "Whether its enable switch is closed; open, its motors stay off");
  table_.text(
      "amplifier", options_.amplifier, "FILE",
      "File that holds what its motors are given, 6 doubles, and holds it when the server is "
      "gone; '' is none");
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
