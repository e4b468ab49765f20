// An interval of allowed values, and how it is told to the user.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace hlm::server {

/// Closed interval; NaN lies in none.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  std::string_view unit;

  bool contains(double value) const noexcept { return value >= low && value <= high; }
};

/// "NAME VALUE UNIT must be LOW to HIGH UNIT" if `value` lies outside; empty if inside.
std::optional<std::string> find_error(std::string_view name, double value, const Range& range);

}  // namespace hlm::server
