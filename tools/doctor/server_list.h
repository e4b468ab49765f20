// All haptic_servers of this machine at a glance: haptic_doctor --all.
#pragma once

#include <string>
#include <vector>

#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

/// A heading, then one aligned line for each; without any, a line that says so and where was
/// looked.
std::string list_as_text(const std::vector<RunningServer>& servers);

/// {"servers": [...]}, with the same numbers; times in s.
std::string list_as_json(const std::vector<RunningServer>& servers);

}  // namespace hlm::server
