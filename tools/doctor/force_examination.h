// Why does a person feel nothing? From a running server's state, or from a recorded session.
#pragma once

#include <optional>
#include <string>

#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/running_server.h"
#include "hlm/tools/replay/recorded_session.h"

namespace hlm::server {

/// `server`: its address, for what is said if its state cannot be read from here.
Examination examine_force(const std::optional<RunningServer>& running, const std::string& server);

/// What stopped the force most of the time, and the chain at the session's end.
Examination examine_force(const RecordedSession& session);

}  // namespace hlm::server
