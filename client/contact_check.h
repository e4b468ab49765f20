// What a simulator gives to be sent, checked at once: a server would refuse it later and elsewhere.
#pragma once

#include <optional>
#include <string>

#include "hlm/common/tool_model.h"
#include "hlm/protocol/messages.h"

namespace hlm {

/// What is wrong with the first contact or body that cannot be meant so, naming its place in the
/// list, the value and what is allowed; empty if nothing is. `tool`: at update.q_VE. Whatever a
/// server would refuse is found, and lengths of another unit: a point kFarthest from its link.
std::optional<std::string> find_error(const protocol::ContactUpdate& update, const ToolModel& tool);

/// No point of a tool that a hand holds is farther away from its link's origin, m.
inline constexpr double kFarthest = 20;

}  // namespace hlm
