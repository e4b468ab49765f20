// What the states of the server are called in the tick log and in reports.
#pragma once

#include <string_view>

#include "protocol/messages.h"

namespace hlm::server {

/// "idle", "running", "silent" or "fault".
std::string_view state_name(protocol::ServerState state) noexcept;
/// "none", "non_finite", "overrun" or "device".
std::string_view state_name(protocol::Fault fault) noexcept;
/// "free_motion", "colliding" or "resting".
std::string_view state_name(protocol::ProxyContactState state) noexcept;

}  // namespace hlm::server
