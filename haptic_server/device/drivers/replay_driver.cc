#include "hlm/device/drivers/replay_driver.h"

#include <array>

#include "hlm/device/replay_device.h"
#include "hlm/device/simulated_device.h"

namespace hlm::server {
namespace {

constexpr double kAny = Range::kInfinite;

constexpr std::array<NumberOf<DeviceRatings>, 13> kRatingNumbers{{
    {{0, kAny, "N"}, "max force", &DeviceRatings::max_force, "Rated force of the recorded device"},
    {{0, kAny, "N·m"}, "max torque", &DeviceRatings::max_torque, "Its rated torque"},
    {{0, kAny, "N/s"},
     "max force rate",
     &DeviceRatings::max_force_rate,
     "Its rated change of force"},
    {{0, kAny, "N·m/s"},
     "max torque rate",
     &DeviceRatings::max_torque_rate,
     "Its rated change of torque"},
    {{0, kAny, "N/m"}, "max stiffness", &DeviceRatings::max_stiffness, "Its rated stiffness"},
    {{0, kAny, "N·m/rad"},
     "max angular stiffness",
     &DeviceRatings::max_angular_stiffness,
     "Its rated angular stiffness"},
    {from_zero("kg"), "mass", &DeviceRatings::mass, "Its mass; 0 is unknown"},
    {from_zero("kg·m²"), "inertia", &DeviceRatings::inertia, "Its inertia; 0 is unknown"},
    {from_zero("N·s/m"), "damping", &DeviceRatings::damping, "Its damping"},
    {from_zero("s"), "rated delay", &DeviceRatings::delay,
     "Its delay from a command to its effect"},
    {{1, kAny, "Hz"}, "exchange rate", &DeviceRatings::exchange_rate, "How often it exchanges"},
    {{1e-3, 1e3}, "scale", &DeviceRatings::scale, "Metres in the world for each of its handle"},
    {{1e-3, 1e3}, "rotation scale", &DeviceRatings::rotation_scale, "Radians, likewise"},
}};

}  // namespace

ReplayDriver::ReplayDriver() : ratings_(ratings_of(SimulatedDeviceOptions{})) {
  ratings_.freedoms = kAllFreedoms;  // A log does not say.
  table_.file("log", log_, "Tick log to play, CSV (required)");
  table_.numbers(ratings_, kRatingNumbers);
}

std::optional<std::string> ReplayDriver::find_error() const {
  if (log_.empty()) return "device replay needs its log: --device-option log=FILE";
  return std::nullopt;
}

std::vector<std::string> ReplayDriver::connected() const {
  return log_.empty() ? std::vector<std::string>{} : std::vector<std::string>{log_};
}

std::unique_ptr<Device> ReplayDriver::open(double) const {
  try {
    return std::make_unique<ReplayDevice>(read_recorded_steps(log_), ratings_);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(error.what());
  }
}

}  // namespace hlm::server
