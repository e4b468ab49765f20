// Do a client's bodies move as it reports? From a recorded session.
#pragma once

#include "hlm/doctor/finding.h"
#include "hlm/replay/recorded_session.h"

namespace hlm::server {

/// What the server found while the session went on.
Examination examine_bodies(const RecordedSession& session);

}  // namespace hlm::server
