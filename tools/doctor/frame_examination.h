// Does the device's frame lie in the world as its key `frame` says?
#pragma once

#include <string>
#include <vector>

#include "hlm/haptic_server/device/workspace.h"
#include "hlm/tools/doctor/device_bench.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/outlook.h"

namespace hlm::server {

/// The person moves the handle to the right, away and up; motors are off. Adds what it finds, also
/// up to where it throws BenchEnded. Whether the frame is right.
bool examine_frame(DeviceBench& bench, Person& person, const Workspace& workspace,
                   const Outlook& outlook, std::vector<Finding>& findings);

}  // namespace hlm::server
