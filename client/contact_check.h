// Checks at once what a simulator wants to send: a server would refuse it later and elsewhere.
#pragma once

#include <optional>
#include <string>

#include "hlm/common/tool_model.h"
#include "hlm/protocol/messages.h"

namespace hlm {

/// What is wrong with the first contact or body that cannot be right, naming its place in the list,
/// the value and what is allowed; empty if all are right. `tool`: at update.q_VE. Finds whatever a
/// server would refuse, and lengths in a wrong unit: a point kFarthest from its link.
std::optional<std::string> find_error(const protocol::ContactUpdate& update, const ToolModel& tool);

/// No point of a hand-held tool is farther from its link's origin than this, m.
inline constexpr double kFarthest = 20;

}  // namespace hlm
