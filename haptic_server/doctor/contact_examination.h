// Can the contacts of a client be trusted? From a recorded session.
#pragma once

#include "hlm/doctor/finding.h"
#include "hlm/protocol/contact_audit.h"
#include "hlm/replay/recorded_session.h"

namespace hlm::server {

/// What the counts say, the first thing to mend first.
std::vector<Finding> findings_on(const protocol::ContactCounts& counts, double epsilon);

Examination examine_contacts(const RecordedSession& session);

}  // namespace hlm::server
