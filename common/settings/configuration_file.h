// What a configuration file says, and where.
#pragma once

#include <string>
#include <vector>

#include "hlm/common/settings/table.h"

namespace hlm::settings {

/// One key of a file, or of the command line, with its values.
struct Assignment {
  std::string table;  ///< "" or the name in [name].
  std::string key;
  Values values;
  std::string name;        ///< How errors call it: "server.toml:3: stiffness", "--stiffness".
  bool from_file = false;  ///< Not from the command line.
};

/// Gives a setting the assigned values. Throws UsageError if it cannot have them.
void set(const Setting& setting, const Assignment& assignment);

/// The keys of a TOML file: numbers, texts, booleans and lists of these, at its top or in a table,
/// in no particular order. Numbers as shortest_text(). Throws UsageError with one line that names
/// the file and the line.
std::vector<Assignment> read_configuration(const std::string& path);

}  // namespace hlm::settings
