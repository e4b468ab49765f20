// Text for a person, as messages hold it.
#pragma once

#include <string_view>

#include "hlm/protocol/messages.h"

namespace hlm::protocol {

/// The part of the text that a message holds, cut between characters of UTF-8, with a space for
/// each control character.
Text to_text(std::string_view text) noexcept;

}  // namespace hlm::protocol
