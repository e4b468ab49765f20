// Is there a device, and what is it rated for?
#pragma once

#include <optional>

#include "haptic_server/device/device_choice.h"
#include "haptic_server/doctor/finding.h"
#include "haptic_server/doctor/running_server.h"

namespace hlm::server {

/// Opens the device that `choice` describes, without moving it and without force; while a server
/// has it, what that says of it. rate: of the servo, Hz.
Examination examine_device(const DeviceChoice& choice, double rate,
                           const std::optional<RunningServer>& running);

}  // namespace hlm::server
