#include "hlm/ve_client/run/check.h"

#include <algorithm>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/scene/scene.h"

namespace hlm::ve {
namespace {

bool has_tools(const Scene& scene) {
  return std::ranges::find(scene.tools, "") == scene.tools.end();
}

/// What only the engine finds wrong.
void try_engine(const Scene& scene, const Settings& settings, Diagnostics& diagnostics) {
  try {
    if (has_tools(scene)) {
      const VirtualEnvironment environment(scene.world, scene.tools, settings.follow);
    } else {
      const World world(scene.world, {});
    }
  } catch (const std::exception& error) {
    diagnostics.refuse({scene.file.string(), 0, ""}, error.what());
  }
}

/// Loads the second tool that the file names too, unless the options choose others than the file's.
Scene scene_with_named_tools(const Settings& settings, Diagnostics& diagnostics) {
  std::vector<ToolChoice> tools = choices(settings);
  const std::size_t asked = tools.size();
  if (tools.front().tool.empty()) tools.resize(kMostTools);
  Scene scene = load_scene(settings.world, tools, diagnostics);
  while (scene.tools.size() > asked && scene.tools.back().empty()) scene.tools.pop_back();
  return scene;
}

void write(const Scene& scene, bool usable, std::ostream& out) {
  const WorldDescription& world = scene.world;
  std::size_t collisions = 0;
  for (const BodyDescription& body : world.bodies) collisions += body.collisions.size();
  const auto fixed = std::ranges::count(world.bodies, true, &BodyDescription::fixed);
  out << fmt::format("{}: models: {}, bodies: {} ({} fixed), collisions: {}, joints: {}\n",
                     scene.file.string(), world.models.size(), world.bodies.size(), fixed,
                     collisions, world.joints.size());
  if (usable && collisions == 0) out << "nothing in it can be touched: it has no <collision>\n";
  if (!has_tools(scene)) {
    out << "no tool: name one with --tool or <haptic:tool>; the models are " << model_names(world)
        << "\n";
  }
}

void write_tools(const Scene& scene, std::ostream& out) {
  for (const std::string& name : scene.tools) {
    if (name.empty()) continue;
    const ToolDescription tool = assemble_tool(scene.world, name).description;
    out << fmt::format("tool '{}': links: {}, degrees of freedom: {}\n", name, tool.links.size(),
                       tool.dof());
  }
}

void write(const Diagnostics& diagnostics, Verdict verdict, const char* title, std::ostream& out) {
  if (diagnostics.count(verdict) == 0) return;
  out << title << ":\n";
  for (const Finding& finding : diagnostics.findings()) {
    if (finding.verdict == verdict) out << "  " << to_string(finding) << "\n";
  }
}

}  // namespace

bool check_scene(const Settings& settings, std::ostream& out) {
  Diagnostics diagnostics(
      {.say = [](const std::string& line) { spdlog::info("{}", line); }, .stopped = {}});
  const Scene scene = scene_with_named_tools(settings, diagnostics);
  if (diagnostics.usable()) try_engine(scene, settings, diagnostics);
  write(scene, diagnostics.usable(), out);
  if (diagnostics.usable()) write_tools(scene, out);
  write(diagnostics, Verdict::kRefused, "refused", out);
  write(diagnostics, Verdict::kApproximated, "approximated", out);
  write(diagnostics, Verdict::kIgnored, "ignored", out);
  out << (diagnostics.usable() ? "can be used\n" : "cannot be used\n");
  return diagnostics.usable();
}

}  // namespace hlm::ve
