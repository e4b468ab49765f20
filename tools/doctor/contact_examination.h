// Can the contacts of a client be trusted? From a recorded session.
#pragma once

#include "hlm/tools/doctor/contact_audit.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/replay/recorded_session.h"

namespace hlm::server {

/// What the counts say, the first thing to mend first.
std::vector<Finding> findings_on(const ContactCounts& counts, double epsilon);

Examination examine_contacts(const RecordedSession& session);

}  // namespace hlm::server
