#include "ve_client/check.h"

#include <algorithm>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "ve_client/frame.h"
#include "ve_client/world/scene.h"

namespace hlm::ve {
namespace {

/// What only the engine finds wrong.
void try_engine(const Scene& scene, const Settings& settings, Diagnostics& diagnostics) {
  try {
    if (scene.tool.empty()) {
      const World world(scene.world, {});
    } else {
      const VirtualEnvironment environment(scene.world, scene.tool, settings.follow);
    }
  } catch (const std::exception& error) {
    diagnostics.refuse({scene.file.string(), 0, ""}, error.what());
  }
}

void write(const Scene& scene, std::ostream& out) {
  const WorldDescription& world = scene.world;
  std::size_t collisions = 0;
  for (const BodyDescription& body : world.bodies) collisions += body.collisions.size();
  const auto fixed = std::ranges::count(world.bodies, true, &BodyDescription::fixed);
  out << fmt::format("{}: models: {}, bodies: {} ({} fixed), collisions: {}, joints: {}\n",
                     scene.file.string(), world.models.size(), world.bodies.size(), fixed,
                     collisions, world.joints.size());
  if (scene.tool.empty()) {
    out << "no tool: name one with --tool or <haptic:tool>; the models are " << model_names(world)
        << "\n";
  }
}

void write_tool(const Scene& scene, std::ostream& out) {
  const ToolDescription tool = assemble_tool(scene.world, scene.tool).description;
  out << fmt::format("tool '{}': links: {}, degrees of freedom: {}\n", scene.tool,
                     tool.links.size(), tool.dof());
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
  Diagnostics diagnostics;
  const Scene scene = load_scene(settings.world, settings.tool, settings.start, diagnostics);
  if (diagnostics.usable()) try_engine(scene, settings, diagnostics);
  write(scene, out);
  if (diagnostics.usable() && !scene.tool.empty()) write_tool(scene, out);
  write(diagnostics, Verdict::kRefused, "refused", out);
  write(diagnostics, Verdict::kApproximated, "approximated", out);
  write(diagnostics, Verdict::kIgnored, "ignored", out);
  out << (diagnostics.usable() ? "can be used\n" : "cannot be used\n");
  return diagnostics.usable();
}

}  // namespace hlm::ve
