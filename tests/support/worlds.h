// Worlds for tests: those in the repository, and small ones made of text.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>

#include "hlm/ve_client/scene/sdf_loader.h"

namespace hlm::test {

/// The repository's worlds: those beside the program where it was packed with them.
inline const std::filesystem::path& worlds_folder() {
  static const std::filesystem::path folder = [] {
    const auto beside = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "worlds";
    return std::filesystem::exists(beside) ? beside : std::filesystem::path(HLM_WORLDS);
  }();
  return folder;
}

/// A world of the repository. Loaded once: that takes a fifth of a second.
inline const ve::WorldDescription& repository_world(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, ve::WorldDescription> loaded;
  const std::lock_guard lock(mutex);
  const auto known = loaded.find(name);
  if (known != loaded.end()) return known->second;
  return loaded.emplace(name, ve::load_world(worlds_folder() / name)).first->second;
}

/// A world with these models (SDF text).
inline ve::WorldDescription world_of(const std::string& models,
                                     const std::string& gravity = "0 0 0") {
  return ve::parse_world("<sdf version='1.9'><world name='w'><gravity>" + gravity + "</gravity>" +
                             models + "</world></sdf>",
                         "test.sdf");
}

/// A collision element with a box (sizes x y z, m).
inline std::string box(const std::string& size) {
  return "<collision name='box'><geometry><box><size>" + size +
         "</size></box></geometry></collision>";
}

/// Inertial element of a 1 kg cube-like body, 1e-3 kg·m² about each axis.
inline const std::string kInertial =
    "<inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia>"
    "</inertial>";

/// A model with one link that holds `contents`.
inline std::string model(const std::string& name, const std::string& pose,
                         const std::string& contents, const std::string& elements = "") {
  return "<model name='" + name + "'><pose>" + pose + "</pose>" + elements + "<link name='body'>" +
         kInertial + contents + "</link></model>";
}

inline std::string fixed_model(const std::string& name, const std::string& pose,
                               const std::string& contents) {
  return model(name, pose, contents, "<static>true</static>");
}

}  // namespace hlm::test
