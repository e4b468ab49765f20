#include "ve_client/world/sdf_support.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace hlm::ve {
namespace {

using Names = std::vector<std::string_view>;

/// Children that are understood, by parent. The contents of other elements are not looked at.
const std::map<std::string_view, Names>& supported_children() {
  static const std::map<std::string_view, Names> kChildren = {
      {"sdf", {"world"}},
      {"world", {"gravity", "frame", "model", "physics", "haptic:tool", "haptic:description"}},
      {"model",
       {"pose", "static", "frame", "link", "joint", "model", "haptic:tool_joint", "haptic:hand",
        "haptic:start"}},
      {"haptic:hand", {"link", "pose"}},
      {"haptic:start", {"name", "pose"}},
      {"link", {"pose", "gravity", "inertial", "collision"}},
      {"collision", {"pose", "geometry", "surface"}},
      {"geometry", {"box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh", "plane"}},
      {"surface", {"friction"}},
      {"friction", {"ode"}},
      {"ode", {"mu"}},
      {"joint", {"pose", "parent", "child", "axis"}},
      {"axis", {"xyz", "limit", "dynamics"}},
      {"dynamics", {"spring_stiffness", "spring_reference", "damping"}},
      {"limit", {"lower", "upper"}},
  };
  return kChildren;
}

/// Whether an element leaves the motion and the contacts of bodies as they are.
bool has_no_effect(std::string_view name) {
  static const Names kNames = {"visual",
                               "light",
                               "scene",
                               "gui",
                               "plugin",
                               "sensor",
                               "atmosphere",
                               "magnetic_field",
                               "audio",
                               "material",
                               "spherical_coordinates",
                               "allow_auto_disable"};
  const bool foreign = name.find(':') != name.npos && !name.starts_with("haptic:");
  return foreign || std::ranges::find(kNames, name) != kNames.end();
}

std::string list(const Names& names) {
  std::string text;
  for (const std::string_view name : names) {
    text += (text.empty() ? "<" : ", <") + std::string(name) + ">";
  }
  return text;
}

}  // namespace

std::string describe(sdf::ElementPtr element) {
  std::string text;
  for (; element; element = element->GetParent()) {
    const std::string& type = element->GetName();
    if (!element->HasAttribute("name") || type == "world") continue;
    std::string own = type;
    own.append(" '").append(element->Get<std::string>("name")).append("'");
    if (!text.empty()) own.append(" ").append(text);
    text = std::move(own);
  }
  return text.empty() ? "world" : text;
}

void require_supported(const sdf::ElementPtr& root) {
  const auto allowed = supported_children().find(root->GetName());
  if (allowed == supported_children().end()) return;
  for (sdf::ElementPtr child = root->GetFirstElement(); child; child = child->GetNextElement()) {
    if (!child->GetExplicitlySetInFile() || has_no_effect(child->GetName())) continue;
    if (std::ranges::find(allowed->second, child->GetName()) == allowed->second.end()) {
      throw std::runtime_error(describe(root) + ": <" + child->GetName() + "> in <" +
                               root->GetName() +
                               "> is not supported; allowed: " + list(allowed->second));
    }
    require_supported(child);
  }
}

}  // namespace hlm::ve
