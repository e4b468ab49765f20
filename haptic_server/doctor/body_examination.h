// Do the bodies of a client what their reports say? From a recorded session.
#pragma once

#include "hlm/doctor/finding.h"
#include "hlm/replay/recorded_session.h"

namespace hlm::server {

/// What the server found while the session went on.
Examination examine_bodies(const RecordedSession& session);

}  // namespace hlm::server
