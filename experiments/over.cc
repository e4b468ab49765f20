#include "experiments/over.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <string_view>

#include <spdlog/fmt/fmt.h>

#include "hlm/common/range.h"
#include "hlm/common/settings/nearest.h"
#include "hlm/haptic_server/device/simulated_driver.h"

namespace hlm::experiments {

using settings::Setting;
using settings::UsageError;

namespace {

constexpr int kMostValues = 10'000;
constexpr std::size_t kMostPoints = 1'000'000;
constexpr const char* kDevice = "device";  ///< Whose values are files.

struct Unit {
  std::string_view name;
  std::string_view of;  ///< The unit that conditions have.
  double factor;
};
constexpr std::array kUnits{Unit{"ms", "s", 1e-3},    Unit{"us", "s", 1e-6},
                            Unit{"µs", "s", 1e-6},    Unit{"kHz", "Hz", 1e3},
                            Unit{"kN/m", "N/m", 1e3}, Unit{"N/mm", "N/m", 1e3},
                            Unit{"g", "kg", 1e-3},    Unit{"mm/s", "m/s", 1e-3},
                            Unit{"mm", "m", 1e-3},    Unit{"%", "", 1e-2}};

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts{""};
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else if (c != ' ') {
      parts.back() += c;
    }
  }
  return parts;
}

/// A number and what follows it.
struct Number {
  double value = 0;
  std::string unit;
};

std::optional<Number> number_of(const std::string& text) {
  Number number;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number.value);
  if (error != std::errc{}) return {};
  number.unit = std::string(end, text.data() + text.size());
  return number;
}

/// Units that a condition's values may have, in words.
std::string allowed_units(const std::string& own) {
  std::string words = own.empty() ? "none" : own;
  for (const Unit& unit : kUnits) {
    if (unit.of == own) words += fmt::format(", {}", unit.name);
  }
  return words;
}

/// Empty for a share or a count.
std::string unit_of(const Setting& setting) {
  return setting.placeholder == "NUMBER" ? "" : setting.placeholder;
}

/// Numbers of one condition, in its own unit.
class Numbers {
 public:
  Numbers(const Setting& setting, std::string name)
      : unit_(unit_of(setting)), name_(std::move(name)) {}

  std::vector<double> read(const std::vector<std::string>& texts) const {
    std::vector<double> numbers;
    std::string unit;
    for (auto text = texts.rbegin(); text != texts.rend(); ++text) {
      std::vector<double> some = range_or_number(*text, unit);
      numbers.insert(numbers.end(), some.rbegin(), some.rend());
      if (numbers.size() > kMostValues) {
        throw UsageError(fmt::format("{} must have at most {} values", name_, kMostValues));
      }
    }
    std::reverse(numbers.begin(), numbers.end());
    return numbers;
  }

 private:
  /// unit: of the next number; becomes this one's, if it has one.
  double read(const std::string& text, std::string& unit) const {
    const auto number = number_of(text);
    if (!number) throw UsageError(fmt::format("{} '{}' must be a number", name_, text));
    if (!number->unit.empty()) unit = number->unit;
    if (unit.empty() || unit == unit_) return number->value;
    const auto* known = std::ranges::find_if(
        kUnits, [&](const Unit& u) { return u.name == unit && u.of == unit_; });
    if (known == kUnits.end()) {
      throw UsageError(fmt::format("{} '{}' has the unit '{}', which must be one of: {}", name_,
                                   text, unit, allowed_units(unit_)));
    }
    // 95 % is 0.95, which 95 times 0.01 is not.
    return known->factor < 1 ? number->value / std::round(1 / known->factor)
                             : number->value * known->factor;
  }

  std::vector<double> range_or_number(const std::string& text, std::string& unit) const {
    const std::vector<std::string> parts = split(text, ':');
    if (parts.size() == 1) return {read(text, unit)};
    const auto count = parts.size() == 3 ? number_of(parts[2]) : std::nullopt;
    const bool log = count && count->unit == "log";
    if (!count || (!log && !count->unit.empty()) || count->value < 2 ||
        count->value > kMostValues || count->value != std::floor(count->value)) {
      throw UsageError(
          fmt::format("{} '{}' must be FIRST:LAST:COUNT or FIRST:LAST:COUNTlog, COUNT 2 "
                      "to {}",
                      name_, text, kMostValues));
    }
    const double last = read(parts[1], unit);
    const double first = read(parts[0], unit);
    if (log && !(first > 0 && last > 0)) {
      throw UsageError(
          fmt::format("{} '{}' must begin and end above 0: its factors are equal", name_, text));
    }
    std::vector<double> numbers;
    for (double i = 0; i < count->value; ++i) {
      const double share = i / (count->value - 1);
      numbers.push_back(log ? first * std::pow(last / first, share)
                            : first + share * (last - first));
    }
    numbers.back() = last;
    return numbers;
  }

  std::string unit_;
  std::string name_;
};

/// Values of a condition, as it takes them.
std::vector<std::string> values_of(const Setting& setting, const std::string& name,
                                   const std::vector<std::string>& texts) {
  std::vector<std::string> values;
  if (setting.quoted) {
    values = texts;
  } else {
    for (const double number : Numbers(setting, name).read(texts)) {
      values.push_back(shortest_text(number));
    }
  }
  std::set<std::string> seen;
  for (const std::string& value : values) {
    if (!seen.insert(value).second) {
      throw UsageError(fmt::format("{} must not have {} twice", name, value));
    }
  }
  return values;
}

/// As tables and cells have it.
Input given(const Setting& setting, const std::string& value) {
  if (setting.is_file) return {setting.key, std::filesystem::path(value).filename().string()};
  if (setting.quoted) return {setting.key, value};
  const std::string unit = unit_of(setting).empty() ? "" : "_" + unit_of(setting);
  return {setting.key + unit, number_of(value)->value};
}

}  // namespace

Over::Over(const std::vector<std::string>& texts, std::filesystem::path files)
    : files_(std::move(files)) {
  for (const std::string& text : texts) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
      throw UsageError("--over '" + text + "' must be NAME=VALUES");
    }
    const std::string name = text.substr(0, equals);
    if (std::ranges::any_of(axes_, [&](const Axis& axis) { return axis.name == name; })) {
      throw UsageError("--over '" + text + "' must not give " + name + " a second time");
    }
    axes_.push_back({name, split(text.substr(equals + 1), ',')});
  }
}

std::vector<std::string> Over::texts() const {
  std::vector<std::string> texts;
  for (const Axis& axis : axes_) {
    std::vector<std::string> values = axis.values;
    for (std::string& value : values) {
      if (axis.name == kDevice) value = std::filesystem::path(value).filename().string();
    }
    texts.push_back(fmt::format("{}={}", axis.name, fmt::join(values, ",")));
  }
  return texts;
}

std::vector<std::filesystem::path> Over::files() const {
  std::vector<std::filesystem::path> files;
  for (const Axis& axis : axes_) {
    for (const std::string& value : axis.values) {
      if (axis.name == kDevice) files.push_back(files_ / value);
    }
  }
  return files;
}

std::vector<Over::Point> Over::points(const settings::Table& table) const {
  std::vector<Point> points{{}};
  for (const Axis& axis : axes_) {
    if (axis.name == kDevice) {
      for (const std::string& file : axis.values) read_device((files_ / file).string());
    }
    const Setting* setting = table.find(axis.name);
    if (!setting) {
      throw UsageError(fmt::format("--over '{}' must be one of: {}{}", axis.name,
                                   fmt::join(table.keys(), ", "),
                                   settings::suggestion(axis.name, table.keys())));
    }
    const std::string name = "--over " + axis.name;
    const std::vector<std::string> values = values_of(*setting, name, axis.values);
    if (values.size() * points.size() > kMostPoints) {
      throw UsageError(
          fmt::format("--over must make at most {} combinations of values", kMostPoints));
    }
    std::vector<Point> more;
    for (const Point& point : points) {
      for (std::string value : values) {
        if (setting->is_file) value = (files_ / value).string();
        more.push_back(point);
        more.back().values.push_back({"", axis.name, {value}, name});
        more.back().given.push_back(given(*setting, value));
      }
    }
    points = std::move(more);
  }
  return points;
}

server::SimulatedDeviceOptions read_device(const std::string& path) {
  if (std::filesystem::exists(path) && !std::filesystem::is_regular_file(path)) {
    throw UsageError(path + " must be a file");
  }
  server::SimulatedDeviceOptions device;
  settings::Table table;
  server::declare(device, table);
  for (const settings::Assignment& each : settings::read_configuration(path)) {
    if (!each.table.empty() && each.table != "device") {
      throw UsageError(fmt::format("{}: table [{}] must be [device]", each.name, each.table));
    }
    if (each.key == "driver") {
      if (each.values == settings::Values{"simulated"}) continue;
      throw UsageError(each.name + " must be simulated");
    }
    if (each.key == "freedom" || each.key == "switched-on" || each.key == "amplifier") {
      throw UsageError(each.name + " has no effect on experiments: it must be left out");
    }
    const Setting* setting = table.find(each.key);
    if (!setting) {
      throw UsageError(fmt::format("{} must be one of: {}{}", each.name,
                                   fmt::join(table.keys(), ", "),
                                   settings::suggestion(each.key, table.keys())));
    }
    settings::set(*setting, each);
  }
  if (const auto error = find_error(device)) throw UsageError(path + ": " + *error);
  return device;
}

void use_device(const std::string& path, server::SimulatedDeviceOptions& device) {
  if (path.empty()) return;
  const server::DeviceFreedom freedom = device.freedom;
  device = read_device(path);
  device.freedom = freedom;
}

}  // namespace hlm::experiments
