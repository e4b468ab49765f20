#include "ve_client/world/scene.h"

#include <algorithm>
#include <stdexcept>
#include <system_error>

#include <tinyxml2.h>

#include "ve_client/world/sdf_loader.h"
#include "ve_client/world/tool_assembly.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExtension = ".sdf";

/// Of a file that may be anything.
std::string description_in(const fs::path& file) {
  tinyxml2::XMLDocument document;
  document.LoadFile(file.c_str());
  const tinyxml2::XMLElement* element = document.RootElement();
  for (const char* name : {"world", "haptic:description"}) {
    if (element != nullptr) element = element->FirstChildElement(name);
  }
  const char* text = element != nullptr ? element->GetText() : nullptr;
  return text != nullptr ? single_spaced(text) : "";
}

/// Whether the file that is meant stands in that folder (canonical).
bool is_inside(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && fs::canonical(file, error).parent_path() == folder;
}

}  // namespace

Scene load_scene(const fs::path& file, const std::string& tool, const std::string& start,
                 Diagnostics& diagnostics) {
  Scene scene{file, load_world(file, diagnostics), tool};
  if (scene.tool.empty()) scene.tool = scene.world.tool;
  // A file that could not be read, or names a tool that it does not have, says so itself.
  const auto& models = scene.world.models;
  const auto model = std::ranges::find(models, scene.tool, &ModelDescription::name);
  const bool reported = model == models.end() && !diagnostics.usable();
  if (scene.tool.empty() || reported) return scene;
  try {
    assemble_tool(with_start(scene.world, scene.tool, start), scene.tool);
  } catch (const std::runtime_error& error) {
    Place place = model == models.end() ? Place{file.string(), 0, ""} : model->place;
    place.element.clear();  // The message names the tool.
    diagnostics.refuse(place, error.what());
  }
  return scene;
}

void require_usable(const Scene& scene, Diagnostics diagnostics) {
  if (scene.tool.empty() && diagnostics.usable()) {
    diagnostics.refuse({scene.file.string(), 0, ""},
                       "which model is the tool? Say it with --tool, or with <haptic:tool> in its "
                       "<world>; it has: " +
                           model_names(scene.world));
  }
  if (!diagnostics.usable()) throw RefusedWorld(std::move(diagnostics));
}

Scene load_scene(const fs::path& file, const std::string& tool, const std::string& start) {
  Diagnostics diagnostics;
  Scene scene = load_scene(file, tool, start, diagnostics);
  require_usable(scene, std::move(diagnostics));
  return scene;
}

std::string scene_name(const fs::path& file) {
  return (file.extension() == kExtension ? file.stem() : file.filename()).string();
}

std::vector<SceneSummary> scenes_beside(const fs::path& file) {
  std::error_code error;
  const fs::path folder = fs::canonical(file.has_parent_path() ? file.parent_path() : ".", error);
  std::vector<fs::path> others;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& other = entry->path();
    const bool is_world = other.extension() == kExtension && is_inside(folder, other);
    if (is_world && other.filename() != file.filename()) others.push_back(other);
  }
  std::ranges::sort(others);
  if (others.size() >= kMostScenes) others.resize(kMostScenes - 1);
  others.insert(std::ranges::lower_bound(others, folder / file.filename()), file);

  std::vector<SceneSummary> scenes;
  for (const fs::path& one : others) scenes.push_back({scene_name(one), one, description_in(one)});
  return scenes;
}

}  // namespace hlm::ve
