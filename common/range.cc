#include "common/range.h"

#include <charconv>
#include <cmath>

namespace hlm {
namespace {

std::string converted(double value, std::chars_format format) {
  char text[32];
  const auto [end, error] = std::to_chars(std::begin(text), std::end(text), value, format);
  return error == std::errc{} ? std::string(text, end) : std::string();
}

}  // namespace

std::string shortest_text(double value) {
  // Beyond these, zeros outnumber digits.
  constexpr double kSmallest = 1e-4;
  constexpr double kLargest = 1e9;
  const double size = std::abs(value);
  const bool fixed = size == 0 || !std::isfinite(value) || (size >= kSmallest && size < kLargest);
  return converted(value, fixed ? std::chars_format::fixed : std::chars_format::scientific);
}

std::string to_string(const Range& range) {
  const std::string least = shortest_text(range.least);
  std::string text;
  if (range.most < Range::kFinite) {
    text = (range.above ? "above " + least + " to " : least + " to ") + shortest_text(range.most);
  } else if (range.least > -Range::kFinite) {
    text = (range.above ? "above " : "at least ") + least;
  } else {
    text = "finite";
    if (range.most == Range::kInfinite) text = "a number";
  }
  if (*range.unit != '\0') text += ' ' + std::string(range.unit);
  if (range.most == Range::kFinite && range.least > -Range::kFinite) text += " and finite";
  return text;
}

std::optional<std::string> find_error(std::string_view name, double value, const Range& range) {
  if (range.contains(value)) return std::nullopt;
  std::string text = std::string(name) + ' ' + shortest_text(value);
  if (*range.unit != '\0') text += ' ' + std::string(range.unit);
  return text + " must be " + to_string(range);
}

}  // namespace hlm
