// How a user gets the right to open haptic devices.
#pragma once

#include <string>

namespace hlm::server {

/// A file of udev rules for haptic devices and for low latency, as the packages install it, with
/// Force Dimension's USB devices. Its comments say where it goes and which groups a user needs.
std::string udev_rules();

}  // namespace hlm::server
