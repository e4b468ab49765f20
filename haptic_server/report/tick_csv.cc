#include "hlm/haptic_server/report/tick_csv.h"

#include <array>
#include <charconv>
#include <string_view>
#include <type_traits>

#include "hlm/haptic_server/report/tick_columns.h"

namespace hlm::server {
namespace {

template <class Value>
void append_value(Value value, std::string& text) {
  if constexpr (std::is_enum_v<Value>) {
    text += name_of(value);
  } else if constexpr (std::is_same_v<Value, bool>) {
    text += value ? '1' : '0';
  } else {
    std::array<char, 32> digits;  // The longest double has 24 characters, the longest integer 20.
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text.append(digits.data(), end);
  }
}

}  // namespace

std::string tick_csv_header() {
  std::string text;
  visit_signals([&](std::string_view name, auto, const auto& suffixes) {
    for (const std::string_view suffix : suffixes) {
      text += name;
      text += suffix;
      text += ',';
    }
  });
  text.back() = '\n';
  return text;
}

void append_tick_csv(const TickRecord& record, std::string& text) {
  visit_signals([&](std::string_view, auto member, const auto& suffixes) {
    for (std::size_t i = 0; i < suffixes.size(); ++i) {
      append_value(component(record.*member, i), text);
      text += ',';
    }
  });
  text.back() = '\n';
}

}  // namespace hlm::server
