// What a menu shows of a world.
#pragma once

#include <filesystem>
#include <string>

namespace hlm::ve {

/// A world that can be chosen; it may turn out to be broken.
struct SceneSummary {
  std::string name;  ///< Name of the file, without .sdf.
  std::filesystem::path file;
  std::string description;  ///< Text of <haptic:description>; empty: not given, or not to be read.
};

}  // namespace hlm::ve
