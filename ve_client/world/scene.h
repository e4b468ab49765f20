// Which world is played with which tool, and which others stand beside it?
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ve_client/world/diagnostics.h"
#include "ve_client/world/world_description.h"

namespace hlm::ve {

/// A world and the model in it that the user holds: one from which an environment can be made.
struct Scene {
  std::filesystem::path file;
  WorldDescription world;
  std::string tool;
};

/// The world in `file`. tool: its model that the user holds; empty: the one that the file names,
/// and if that names none the scene has none. start: where that begins, for the check that there is
/// such a start. All that is wrong with world and tool is refused to `diagnostics`; the scene is
/// then what is left.
Scene load_scene(const std::filesystem::path& file, const std::string& tool,
                 const std::string& start, Diagnostics& diagnostics);

/// Throws RefusedWorld where something was refused, or the scene has no tool.
void require_usable(const Scene& scene, Diagnostics diagnostics);

/// Both in one.
Scene load_scene(const std::filesystem::path& file, const std::string& tool = "",
                 const std::string& start = "");

/// A world that can be chosen; it may turn out to be broken.
struct SceneSummary {
  std::string name;  ///< Of the file, without .sdf.
  std::filesystem::path file;
  std::string description;  ///< Its <haptic:description>; empty: not given, or not to be read.
};

/// More than these, and the menu of them is no longer one.
inline constexpr std::size_t kMostScenes = 100;

std::string scene_name(const std::filesystem::path& file);

/// `file` and the *.sdf in its folder, by name, at most kMostScenes. Links that lead out of the
/// folder are left out. Their worlds are not checked: that takes a fifth of a second for each.
std::vector<SceneSummary> scenes_beside(const std::filesystem::path& file);

}  // namespace hlm::ve
