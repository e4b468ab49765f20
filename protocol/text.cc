#include "hlm/protocol/text.h"

#include <algorithm>
#include <cstddef>

namespace hlm::protocol {

Text to_text(std::string_view text) noexcept {
  Text kept;
  std::size_t length = std::min(text.size(), kept.capacity());
  const auto continues_character = [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u;
  };
  while (length > 0 && length < text.size() && continues_character(text[length])) --length;
  for (const char c : text.substr(0, length)) {
    const auto code = static_cast<unsigned char>(c);
    kept.push_back(code < 0x20 || code == 0x7F ? ' ' : c);
  }
  return kept;
}

}  // namespace hlm::protocol
