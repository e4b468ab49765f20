// Is there a device, and what is it rated for?
#pragma once

#include <memory>
#include <optional>

#include "hlm/haptic_server/device/device_choice.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

inline constexpr const char* kDeviceQuestion = "Is there a device?";

/// The device that `choice` describes, opened as the server does, without force; empty if there is
/// none. Adds what it says of itself, or why it cannot be opened. rate: of the servo, Hz.
std::unique_ptr<Device> open_examined(const DeviceChoice& choice, double rate,
                                      Examination& examination);

/// The same, and closes it; while a server has it, what that says of it.
Examination examine_device(const DeviceChoice& choice, double rate,
                           const std::optional<RunningServer>& running);

}  // namespace hlm::server
