// Values that the user gives to conditions of an experiment: --over NAME=VALUES.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "experiments/cell.h"
#include "hlm/common/settings/configuration_file.h"
#include "hlm/haptic_server/device/simulated_device.h"

namespace hlm::experiments {

/// Conditions with values of the user's, and which these are, by the names that tables have.
template <class Conditions>
struct Variant {
  Conditions conditions;
  Inputs given;
};

/// VALUES are numbers, FIRST:LAST:COUNT with equal steps, FIRST:LAST:COUNTlog with equal factors,
/// or words, apart by commas. A number may have a unit; without one it has that of the next that
/// has one or, if none has, the condition's own. "delay=0,20ms", "stiffness=4e3:64e3:5log".
class Over {
 public:
  /// files: the folder of files that values name. Throws settings::UsageError for a text that is
  /// not NAME=VALUES.
  explicit Over(const std::vector<std::string>& texts, std::filesystem::path files = {});

  bool any() const { return !axes_.empty(); }
  /// The texts with files by their names alone.
  std::vector<std::string> texts() const;
  /// Those that values name.
  std::vector<std::filesystem::path> files() const;

  /// `usual` with each combination of the values. `declare` binds names to variables of conditions:
  /// declare(table, conditions). Throws settings::UsageError naming a value and what is allowed.
  template <class Conditions, class Declare>
  std::vector<Variant<Conditions>> variants(const Conditions& usual, const Declare& declare) const {
    Conditions conditions = usual;
    settings::Table table;
    declare(table, conditions);
    std::vector<Variant<Conditions>> variants;
    for (const Point& point : points(table)) {
      conditions = usual;
      for (const settings::Assignment& value : point.values) {
        settings::set(*table.find(value.key), value);
      }
      variants.push_back({conditions, point.given});
    }
    return variants;
  }

 private:
  struct Axis {
    std::string name;
    std::vector<std::string> values;
  };
  struct Point {
    std::vector<settings::Assignment> values;
    Inputs given;
  };
  std::vector<Point> points(const settings::Table& table) const;

  std::vector<Axis> axes_;
  std::filesystem::path files_;
};

/// A device as the server's configuration has it: the keys of the simulated one, in [device] or at
/// the top. Throws settings::UsageError naming file, line and key.
server::SimulatedDeviceOptions read_device(const std::string& path);

/// That device instead, if there is a file; how it can move stays.
void use_device(const std::string& path, server::SimulatedDeviceOptions& device);

}  // namespace hlm::experiments
