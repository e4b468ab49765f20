#include "hlm/ve_client/scene/scene.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <system_error>

#include <tinyxml2.h>

#include "hlm/ve_client/scene/sdf_loader.h"
#include "hlm/ve_client/scene/tool_assembly.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExtension = ".sdf";

/// How a person names each tool.
struct ToolWords {
  const char* name;
  const char* option;
  const char* element;
};
constexpr std::array<ToolWords, kMostTools> kToolWords{
    {{"tool", "--tool", "<haptic:tool>"},
     {"second tool", "--second-tool", "<haptic:second_tool>"}}};

/// The description in a file that may be anything.
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

/// Refuses what no tool can be made of.
void check_tool(const Scene& scene, const std::string& tool, const std::string& start,
                Diagnostics& diagnostics) {
  // A file that could not be read, or names a tool that it does not have, says so itself.
  const auto& models = scene.world.models;
  const auto model = std::ranges::find(models, tool, &ModelDescription::name);
  const bool reported = model == models.end() && !diagnostics.usable();
  if (tool.empty() || reported) return;
  try {
    assemble_tool(with_start(scene.world, tool, start), tool);
  } catch (const std::runtime_error& error) {
    Place place = model == models.end() ? Place{scene.file.string(), 0, ""} : model->place;
    place.element.clear();  // The message names the tool.
    diagnostics.refuse(place, error.what());
  }
}

}  // namespace

Scene load_scene(const fs::path& file, const std::vector<ToolChoice>& tools,
                 Diagnostics& diagnostics) {
  Scene scene{file, load_world(file, diagnostics), {}};
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const std::string& tool = tools[i].tool.empty() ? scene.world.tools[i] : tools[i].tool;
    if (!tool.empty() && std::ranges::find(scene.tools, tool) != scene.tools.end()) {
      diagnostics.refuse({file.string(), 0, ""},
                         "tool '" + tool + "' is named twice: each hand holds its own");
    }
    scene.tools.push_back(tool);
    check_tool(scene, tool, tools[i].start, diagnostics);
  }
  return scene;
}

void require_usable(const Scene& scene, Diagnostics diagnostics) {
  for (std::size_t i = 0; i < scene.tools.size() && diagnostics.usable(); ++i) {
    if (!scene.tools[i].empty()) continue;
    const auto& [name, option, element] = kToolWords[i];
    diagnostics.refuse({scene.file.string(), 0, ""},
                       std::string("which model is the ") + name + "? Say it with " + option +
                           ", or with " + element +
                           " in its <world>; it has: " + model_names(scene.world));
  }
  if (!diagnostics.usable()) throw RefusedWorld(std::move(diagnostics));
}

Scene load_scene(const fs::path& file, const std::vector<ToolChoice>& tools, Progress progress) {
  Diagnostics diagnostics(std::move(progress));
  Scene scene = load_scene(file, tools, diagnostics);
  require_usable(scene, std::move(diagnostics));
  return scene;
}

WorldDescription with_starts(const Scene& scene, const std::vector<ToolChoice>& tools) {
  WorldDescription world = scene.world;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    world = with_start(std::move(world), scene.tools[i], tools[i].start);
  }
  return world;
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
