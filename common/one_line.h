// What a file or a peer says, in a message to a person.
#pragma once

#include <algorithm>
#include <string>

namespace hlm {

/// The text with a space for each control character: it cannot break the line that it stands in,
/// nor steer the terminal.
inline std::string one_line(std::string text) {
  const auto is_control = [](char c) {
    const auto code = static_cast<unsigned char>(c);
    return code < 0x20 || code == 0x7F;
  };
  std::ranges::replace_if(text, is_control, ' ');
  return text;
}

}  // namespace hlm
