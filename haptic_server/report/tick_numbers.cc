#include "hlm/haptic_server/report/tick_numbers.h"

#include <string_view>
#include <type_traits>

#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/report/tick_columns.h"

namespace hlm::server {
namespace {

/// What a number stands for: "=WORD|WORD" of an enumeration, otherwise nothing.
template <class Value>
std::string words_of() {
  std::string text;
  if constexpr (std::is_enum_v<Value>) {
    for (const auto& word : kWords<Value>) {
      text += text.empty() ? '=' : '|';
      text += word.name;
    }
  }
  return text;
}

}  // namespace

std::string tick_number_names() {
  const TickRecord record;
  std::string text;
  visit_signals([&](std::string_view name, auto member, const auto& suffixes) {
    using Value = std::decay_t<decltype(component(record.*member, 0))>;
    for (const std::string_view suffix : suffixes) {
      if (!text.empty()) text += ',';
      text.append(name).append(suffix).append(words_of<Value>());
    }
  });
  return text;
}

std::size_t tick_number_count() {
  std::size_t count = 0;
  visit_signals([&](std::string_view, auto, const auto& suffixes) { count += suffixes.size(); });
  return count;
}

double* copy_numbers(const TickRecord& record, double* to) {
  visit_signals([&](std::string_view, auto member, const auto& suffixes) {
    for (std::size_t i = 0; i < suffixes.size(); ++i) {
      *to++ = static_cast<double>(component(record.*member, i));
    }
  });
  return to;
}

}  // namespace hlm::server
