// What a number can be, and the one sentence that says so.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "hlm/common/sentence.h"

namespace hlm {

/// The numbers from `least` to `most`, both included; NaN is in no range. A `most` of infinity
/// includes infinity itself, kFinite every finite number.
struct Range {
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
  static constexpr double kFinite = std::numeric_limits<double>::max();

  double least = -kFinite;
  double most = kFinite;
  const char* unit = "";
  bool above = false;  ///< `least` itself is excluded.

  constexpr bool contains(double value) const noexcept {
    return (above ? value > least : value >= least) && value <= most;
  }
};

/// Every finite number above zero.
constexpr Range above_zero(const char* unit) noexcept { return {0, Range::kFinite, unit, true}; }
/// Every finite number from zero on.
constexpr Range from_zero(const char* unit) noexcept { return {0, Range::kFinite, unit}; }

/// The shortest decimal text that is read back as the same number.
std::string shortest_text(double value);
/// The same, without allocation.
Sentence brief_text(double value) noexcept;

/// "0.1 to 1000 N", "at least 0.01 N", "above 0 m and finite".
std::string to_string(const Range& range);

/// "NAME VALUE UNIT must be RANGE" if `value` is outside; empty if inside.
std::optional<std::string> find_error(std::string_view name, double value, const Range& range);
/// The same, without allocation, for names that are short.
std::optional<Sentence> find_brief_error(std::string_view name, double value,
                                         const Range& range) noexcept;

/// A number of a structure and what it can be.
template <class Owner>
struct NumberOf : Range {
  const char* name;       ///< Name as a person says it: "release step".
  double Owner::*number;  ///< Where it is.
  const char* help;       ///< What it is, for a person.
};

/// The first number outside its range.
template <class Owner, std::size_t n>
std::optional<std::string> find_error(const Owner& owner,
                                      const std::array<NumberOf<Owner>, n>& numbers) {
  for (const NumberOf<Owner>& each : numbers) {
    if (auto error = find_error(each.name, owner.*each.number, each)) return error;
  }
  return std::nullopt;
}

}  // namespace hlm
