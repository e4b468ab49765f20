// What a simulator gives to be sent, checked at once: a server would refuse it later and elsewhere.
#pragma once

#include <optional>
#include <string>

#include "common/contact.h"
#include "common/tool_model.h"

namespace hlm {

/// What is wrong with the first contact or body that cannot be meant so, naming its place in the
/// list, the value and what is allowed; empty if nothing is. `tool`: at the configuration for which
/// the contacts hold. Found: numbers that are not finite, normals that are not unit, identities and
/// body ids that come twice, links and sides that cannot be, and lengths of another unit (a point
/// kFarthest away from its link).
std::optional<std::string> find_error(const ReportedContacts& contacts, const MovableBodies& bodies,
                                      const ToolModel& tool);

/// No point of a tool that a hand holds is farther away from its link's origin, m.
inline constexpr double kFarthest = 20;

}  // namespace hlm
