// Fixed models that are meshes, from the text of a Wavefront file.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>

#include <unistd.h>

#include "tests/support/worlds.h"

namespace hlm::test {

/// A file with this text, which goes with the process.
inline std::string mesh_file(const std::string& obj) {
  struct Files {
    ~Files() {
      for (const auto& [text, path] : paths) std::filesystem::remove(path);
    }
    std::mutex mutex;
    std::map<std::string, std::filesystem::path> paths;
  };
  static Files files;
  const std::lock_guard lock(files.mutex);
  const auto known = files.paths.find(obj);
  if (known != files.paths.end()) return known->second;
  const auto path =
      std::filesystem::temp_directory_path() / ("haptic_mesh_" + std::to_string(getpid()) + '_' +
                                                std::to_string(files.paths.size()) + ".obj");
  std::ofstream(path) << obj;
  return files.paths.emplace(obj, path).first->second;
}

/// Its surface without friction.
inline std::string mesh_model(const std::string& name, const std::string& obj) {
  return fixed_model(name, "0 0 0 0 0 0",
                     "<collision name='mesh'><geometry><mesh><uri>" + mesh_file(obj) +
                         "</uri></mesh></geometry></collision>");
}

/// The text of a trough of a bowl: the inside of a sphere about the origin, of that radius (m) at
/// the corners, within 0.75 rad of its lowest point (-y) along x and 0.06 rad along z, with facets
/// of 0.01 rad.
inline std::string bowl_obj(double radius) {
  constexpr int kAlong = 150;
  constexpr int kAcross = 12;
  std::ostringstream text;
  text.precision(15);
  for (int i = 0; i <= kAlong; ++i) {
    const double along = 0.01 * (i - kAlong / 2);
    for (int j = 0; j <= kAcross; ++j) {
      const double across = 0.01 * (j - kAcross / 2);
      text << "v " << radius * std::sin(along) * std::cos(across) << ' '
           << -radius * std::cos(along) * std::cos(across) << ' ' << radius * std::sin(across)
           << '\n';
    }
  }
  const auto at = [](int i, int j) { return 1 + i * (kAcross + 1) + j; };
  for (int i = 0; i < kAlong; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      text << "f " << at(i, j) << ' ' << at(i, j + 1) << ' ' << at(i + 1, j + 1) << '\n';
      text << "f " << at(i, j) << ' ' << at(i + 1, j + 1) << ' ' << at(i + 1, j) << '\n';
    }
  }
  return text.str();
}

}  // namespace hlm::test
