// A person at the device's machine lets a fault of its server end.
#pragma once

#include <string>

#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

/// Tells the server, and returns a sentence that says what ends. Throws std::runtime_error if it
/// cannot be told.
std::string release_fault(const RunningServer& server);

}  // namespace hlm::server
