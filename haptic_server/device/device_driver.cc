#include "hlm/haptic_server/device/device_driver.h"

#include <algorithm>

namespace hlm::server {
namespace {

const DriverRegistration* latest = nullptr;

}  // namespace

DriverRegistration::DriverRegistration(Make make) noexcept : make_(make), next_(latest) {
  latest = this;
}

std::vector<std::unique_ptr<DeviceDriver>> registered_drivers() {
  std::vector<std::unique_ptr<DeviceDriver>> drivers;
  for (auto* each = latest; each != nullptr; each = each->next_) drivers.push_back(each->make_());
  std::ranges::sort(drivers, {}, [](const auto& driver) { return driver->name(); });
  return drivers;
}

}  // namespace hlm::server
