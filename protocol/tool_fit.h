// Whether a message belongs to the session's tool: lengths, unit quaternions, links.
#pragma once

#include <optional>
#include <string>

#include "common/tool_description.h"
#include "common/tool_model.h"
#include "protocol/messages.h"

namespace hlm::protocol {

/// Whether q has the tool's length and, of a free root, a unit quaternion.
bool fits(const ToolDescription& tool, const Configuration& q) noexcept;
/// Whether configuration, velocity and the contacts' links are possible with the tool.
bool fits(const ToolDescription& tool, const ContactUpdate& update) noexcept;
bool fits(const ToolDescription& tool, const ProxyState& state) noexcept;

/// Why a hello cannot be used, naming the value and what is allowed; empty if it can. Allocates
/// only the text.
std::optional<std::string> find_error(const Hello& hello);

}  // namespace hlm::protocol
