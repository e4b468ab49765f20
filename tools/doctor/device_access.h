// How a user gets the right to open haptic devices.
#pragma once

#include <string>

namespace hlm::server {

/// The file of udev rules for haptic devices and for low latency that the packages install, under
/// two comments that say where it goes and which groups a user needs.
std::string udev_rules();

}  // namespace hlm::server
