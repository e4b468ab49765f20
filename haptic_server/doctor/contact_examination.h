// Can the contacts of a client be trusted? From a recorded session.
#pragma once

#include "haptic_server/doctor/finding.h"
#include "haptic_server/replay/recorded_session.h"
#include "protocol/contact_audit.h"

namespace hlm::server {

/// What the counts say, the first thing to mend first.
std::vector<Finding> findings_on(const protocol::ContactCounts& counts, double epsilon);

Examination examine_contacts(const RecordedSession& session);

}  // namespace hlm::server
