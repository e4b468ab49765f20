// Which world is played with which tool, and which others stand next to it?
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "hlm/page/scene_summary.h"
#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// A model that somebody holds.
struct ToolChoice {
  std::string tool;   ///< Empty: the one that the world names.
  std::string start;  ///< One of its <haptic:start>; empty: as placed.
};

/// A world and the models in it that users hold: one from which an environment can be made.
struct Scene {
  std::filesystem::path file;
  WorldDescription world;
  std::vector<std::string> tools;
};

/// The world in `file`, with as many tools as are chosen, 1 to kMostTools; one that neither the
/// choice nor the file names is empty. The starts are for the check that there are such. All that
/// is wrong with world and tools is refused to `diagnostics`; the scene is then what is left.
Scene load_scene(const std::filesystem::path& file, const std::vector<ToolChoice>& tools,
                 Diagnostics& diagnostics);

/// Throws RefusedWorld where something was refused, or a tool is not named.
void require_usable(const Scene& scene, Diagnostics diagnostics);

/// Both in one.
Scene load_scene(const std::filesystem::path& file, const std::vector<ToolChoice>& tools = {{}},
                 Progress progress = {});

/// The scene's world, with its tools where the choices say.
WorldDescription with_starts(const Scene& scene, const std::vector<ToolChoice>& tools);

/// More than these, and the menu of them is no longer one.
inline constexpr std::size_t kMostScenes = 100;

std::string scene_name(const std::filesystem::path& file);

/// `file` and the *.sdf in its folder, by name, at most kMostScenes. Links that lead out of the
/// folder are left out. Their worlds are not checked: that takes a fifth of a second for each.
std::vector<SceneSummary> scenes_beside(const std::filesystem::path& file);

}  // namespace hlm::ve
