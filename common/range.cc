#include "hlm/common/range.h"

#include <charconv>
#include <cmath>

namespace hlm {
namespace {

/// A number's shortest text.
class Digits {
 public:
  explicit Digits(double value) noexcept {
    // Beyond these, zeros outnumber digits.
    constexpr double kSmallest = 1e-4;
    constexpr double kLargest = 1e9;
    const double size = std::abs(value);
    const bool fixed = size == 0 || !std::isfinite(value) || (size >= kSmallest && size < kLargest);
    const auto format = fixed ? std::chars_format::fixed : std::chars_format::scientific;
    const char* const end = std::to_chars(std::begin(text_), std::end(text_), value, format).ptr;
    size_ = static_cast<std::size_t>(end - text_);
  }
  operator std::string_view() const noexcept { return {text_, size_}; }

 private:
  char text_[32];
  std::size_t size_;
};

template <class Text>
void append(Text& text, const Range& range) {
  const Digits least(range.least);
  if (range.most < Range::kFinite) {
    if (range.above) text.append("above ");
    text.append(least).append(" to ").append(Digits(range.most));
  } else if (range.least > -Range::kFinite) {
    text.append(range.above ? "above " : "at least ").append(least);
  } else {
    text.append(range.most == Range::kInfinite ? "a number" : "finite");
  }
  if (*range.unit != '\0') text.append(" ").append(range.unit);
  if (range.most == Range::kFinite && range.least > -Range::kFinite) text.append(" and finite");
}

template <class Text>
Text error_of(std::string_view name, double value, const Range& range) {
  Text text(name);
  text.append(" ").append(Digits(value));
  if (*range.unit != '\0') text.append(" ").append(range.unit);
  text.append(" must be ");
  append(text, range);
  return text;
}

}  // namespace

std::string shortest_text(double value) { return std::string(Digits(value)); }

Sentence brief_text(double value) noexcept { return Sentence(Digits(value)); }

std::string to_string(const Range& range) {
  std::string text;
  append(text, range);
  return text;
}

std::optional<std::string> find_error(std::string_view name, double value, const Range& range) {
  if (range.contains(value)) return std::nullopt;
  return error_of<std::string>(name, value, range);
}

std::optional<Sentence> find_brief_error(std::string_view name, double value,
                                         const Range& range) noexcept {
  if (range.contains(value)) return std::nullopt;
  return error_of<Sentence>(name, value, range);
}

}  // namespace hlm
