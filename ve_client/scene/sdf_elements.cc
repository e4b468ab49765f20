#include "hlm/ve_client/scene/sdf_elements.h"

#include <algorithm>
#include <vector>

namespace hlm::ve {
namespace {

constexpr std::optional<Verdict> kUsed = std::nullopt;
constexpr auto kIgnored = Verdict::kIgnored;
constexpr auto kApproximated = Verdict::kApproximated;
constexpr auto kRefused = Verdict::kRefused;

constexpr std::string_view kNoPart = "no part in contact";
constexpr std::string_view kOtherEngine = "tunes another solver or engine";
constexpr std::string_view kHard = "contacts are as stiff as the server sets";
constexpr std::string_view kAll = "everything collides with everything";
constexpr std::string_view kIsotropic = "friction is the same in all directions, with mu";
constexpr std::string_view kMesh =
    "the collision is left out; make it a mesh, or of box, sphere, cylinder, cone, capsule or "
    "ellipsoid";

constexpr ElementRule kRules[] = {
    {"world/model", kUsed, ""},
    {"world/include", kUsed, ""},
    {"world/frame", kUsed, ""},
    {"world/gravity", kUsed, ""},
    {"world/haptic:tool", kUsed, "the model that the user holds"},
    {"world/haptic:second_tool", kUsed, "the model that a second hand holds"},
    {"world/haptic:description", kUsed, "what is to be felt"},
    {"world/physics/max_step_size", kUsed, ""},
    {"world/physics/ode/solver/iters", kUsed, ""},
    {"world/physics/ode/solver", kIgnored, kOtherEngine},
    {"world/physics/ode/constraints", kIgnored, kOtherEngine},
    {"world/physics/real_time_factor", kIgnored, "worlds run in real time"},
    {"world/physics/real_time_update_rate", kIgnored, "worlds run in real time"},
    {"world/physics/max_contacts", kIgnored, kNoPart},
    {"world/physics/dart", kIgnored, kOtherEngine},
    {"world/physics/simbody", kIgnored, kOtherEngine},
    {"world/physics/bullet", kIgnored, kOtherEngine},
    {"world/audio", kIgnored, kNoPart},
    {"world/wind", kIgnored, "there is no wind"},
    {"world/magnetic_field", kIgnored, kNoPart},
    {"world/atmosphere", kIgnored, kNoPart},
    {"world/gui", kIgnored, kNoPart},
    {"world/scene", kIgnored, kNoPart},
    {"world/light", kIgnored, kNoPart},
    {"world/plugin", kIgnored, "plugins are not run"},
    {"world/road", kIgnored, kNoPart},
    {"world/spherical_coordinates", kIgnored, kNoPart},
    {"world/actor", kApproximated, "it is left out, and nothing can touch it"},
    {"world/state", kApproximated, "it is not read; models begin at their own poses"},
    {"world/joint", kRefused, "put both models into one, with the joint"},
    {"world/population", kRefused, "write its models out"},

    {"model/pose", kUsed, ""},
    {"model/static", kUsed, ""},
    {"model/frame", kUsed, ""},
    {"model/model", kUsed, ""},
    {"model/include", kUsed, ""},
    {"model/haptic:tool_joint", kUsed, "how the tool moves in the world"},
    {"model/haptic:hand/link", kUsed, "the link that the user holds"},
    {"model/haptic:hand/pose", kUsed, "where on it"},
    {"model/haptic:gripper/joint", kUsed, "a jaw's, which a servo moves"},
    {"model/haptic:gripper/closed", kUsed, "its position, rad or m"},
    {"model/haptic:gripper/open", kUsed, ""},
    {"model/haptic:gripper/stiffness", kUsed, "of the servo, N/m or N·m/rad"},
    {"model/haptic:gripper/damping", kUsed, "N·s/m or N·m·s/rad"},
    {"model/haptic:gripper/force", kUsed, "its largest, N or N·m"},
    {"model/haptic:start/name", kUsed, "another place where the tool may begin"},
    {"model/haptic:start/pose", kUsed, ""},
    {"model/self_collide", kApproximated, "links of a model collide, unless a joint joins them"},
    {"model/allow_auto_disable", kIgnored, kNoPart},
    {"model/enable_wind", kIgnored, "there is no wind"},
    {"model/plugin", kIgnored, "plugins are not run"},
    {"model/gripper", kApproximated, "it is not read; haptic:gripper is"},

    {"model/link/pose", kUsed, ""},
    {"model/link/gravity", kUsed, ""},
    {"model/link/inertial/mass", kUsed, ""},
    {"model/link/inertial/pose", kUsed, ""},
    {"model/link/inertial/inertia", kUsed, ""},
    {"model/link/inertial/fluid_added_mass", kApproximated, "bodies move without a fluid"},
    {"model/link/kinematic", kUsed, "only false"},
    {"model/link/self_collide", kApproximated,
     "links of a model collide, unless a joint joins them"},
    {"model/link/enable_wind", kIgnored, "there is no wind"},
    {"model/link/must_be_base_link", kIgnored, kNoPart},
    {"model/link/velocity_decay", kApproximated, "bodies move without drag"},
    {"model/link/visual", kIgnored, kNoPart},
    {"model/link/sensor", kIgnored, kNoPart},
    {"model/link/light", kIgnored, kNoPart},
    {"model/link/plugin", kIgnored, "plugins are not run"},
    {"model/link/projector", kIgnored, kNoPart},
    {"model/link/audio_sink", kIgnored, kNoPart},
    {"model/link/audio_source", kIgnored, kNoPart},
    {"model/link/battery", kIgnored, kNoPart},
    {"model/link/particle_emitter", kIgnored, kNoPart},

    {"model/link/collision/pose", kUsed, ""},
    {"model/link/collision/laser_retro", kIgnored, kNoPart},
    {"model/link/collision/max_contacts", kIgnored, "all contacts are found"},
    {"model/link/collision/geometry/box", kUsed, ""},
    {"model/link/collision/geometry/sphere", kUsed, ""},
    {"model/link/collision/geometry/cylinder", kUsed, ""},
    {"model/link/collision/geometry/capsule", kUsed, ""},
    {"model/link/collision/geometry/ellipsoid", kUsed, ""},
    {"model/link/collision/geometry/cone/radius", kUsed,
     "as the hull of its tip and 32 points of its rim"},
    {"model/link/collision/geometry/cone/length", kUsed, ""},
    {"model/link/collision/geometry/mesh/uri", kUsed, "a file of triangles"},
    {"model/link/collision/geometry/mesh/scale", kUsed, ""},
    {"model/link/collision/geometry/mesh/submesh", kUsed, ""},
    {"model/link/collision/geometry/mesh/haptic:pieces", kUsed, "hull, triangles or parts"},
    {"model/link/collision/geometry/heightmap/uri", kUsed, "a grey PNG image, in static models"},
    {"model/link/collision/geometry/heightmap/size", kUsed, ""},
    {"model/link/collision/geometry/heightmap/pos", kUsed, ""},
    {"model/link/collision/geometry/heightmap/sampling", kIgnored,
     "each of the image's pixels is a height"},
    {"model/link/collision/geometry/heightmap/texture", kIgnored, kNoPart},
    {"model/link/collision/geometry/heightmap/blend", kIgnored, kNoPart},
    {"model/link/collision/geometry/heightmap/use_terrain_paging", kIgnored, kNoPart},
    {"model/link/collision/geometry/plane", kUsed,
     "a half-space, in static models, whatever its size"},
    {"model/link/collision/geometry/empty", kApproximated, "the collision is left out"},
    {"model/link/collision/geometry/image", kApproximated, kMesh},
    {"model/link/collision/geometry/polyline", kApproximated, kMesh},
    {"model/link/collision/surface/friction/ode/mu", kUsed,
     "1 if it is not given; more than 10 counts as 10"},
    {"model/link/collision/surface/friction/ode/mu2", kApproximated, kIsotropic},
    {"model/link/collision/surface/friction/ode/fdir1", kApproximated, kIsotropic},
    {"model/link/collision/surface/friction/ode/slip1", kApproximated, kIsotropic},
    {"model/link/collision/surface/friction/ode/slip2", kApproximated, kIsotropic},
    {"model/link/collision/surface/friction/torsional", kApproximated,
     "contacts bear no torque about their normal"},
    {"model/link/collision/surface/friction/bullet", kIgnored, kOtherEngine},
    {"model/link/collision/surface/bounce", kApproximated,
     "bodies do not bounce; the server has --restitution"},
    {"model/link/collision/surface/contact/ode", kIgnored, kHard},
    {"model/link/collision/surface/contact/bullet", kIgnored, kOtherEngine},
    {"model/link/collision/surface/contact/poissons_ratio", kIgnored, kHard},
    {"model/link/collision/surface/contact/elastic_modulus", kIgnored, kHard},
    {"model/link/collision/surface/contact/collide_bitmask", kApproximated, kAll},
    {"model/link/collision/surface/contact/category_bitmask", kApproximated, kAll},
    {"model/link/collision/surface/contact/collide_without_contact", kApproximated, kAll},
    {"model/link/collision/surface/contact/collide_without_contact_bitmask", kApproximated, kAll},
    {"model/link/collision/surface/soft_contact", kApproximated, "bodies are rigid"},

    {"model/joint/pose", kUsed, ""},
    {"model/joint/parent", kUsed, ""},
    {"model/joint/child", kUsed, ""},
    {"model/joint/axis/xyz", kUsed, ""},
    {"model/joint/axis/limit/lower", kUsed, ""},
    {"model/joint/axis/limit/upper", kUsed, ""},
    {"model/joint/axis/limit/effort", kIgnored, "joints have no motors"},
    {"model/joint/axis/limit/velocity", kIgnored, "joints have no motors"},
    {"model/joint/axis/limit/stiffness", kApproximated, "limits are rigid"},
    {"model/joint/axis/limit/dissipation", kApproximated, "limits are rigid"},
    {"model/joint/axis/dynamics/damping", kUsed, "not in a tool"},
    {"model/joint/axis/dynamics/spring_stiffness", kUsed, "not in a tool"},
    {"model/joint/axis/dynamics/spring_reference", kUsed, ""},
    {"model/joint/axis/dynamics/friction", kApproximated, "joints move without friction"},
    {"model/joint/axis/initial_position", kApproximated, "joints begin at 0"},
    {"model/joint/axis2", kIgnored, "only joints that are refused have a second axis"},
    {"model/joint/physics", kIgnored, kOtherEngine},
    {"model/joint/sensor", kIgnored, kNoPart},
    {"model/joint/thread_pitch", kIgnored, "only joints that are refused have a thread"},
    {"model/joint/screw_thread_pitch", kIgnored, "only joints that are refused have a thread"},
    {"model/joint/gearbox_ratio", kIgnored, "only joints that are refused have gears"},
    {"model/joint/gearbox_reference_body", kIgnored, "only joints that are refused have gears"},
};

constexpr ElementRule kForeign{"", kIgnored, "belongs to another program"};

std::string_view parent_of(std::string_view path) {
  const std::size_t slash = path.rfind('/');
  return slash == path.npos ? "" : path.substr(0, slash);
}

bool is_below(std::string_view path, std::string_view ancestor) {
  return path.size() > ancestor.size() && path.starts_with(ancestor) &&
         path[ancestor.size()] == '/';
}

bool is_foreign(std::string_view path) {
  const std::string_view name = path.substr(path.rfind('/') + 1);
  return name.find(':') != name.npos && !name.starts_with("haptic:");
}

}  // namespace

std::span<const ElementRule> element_rules() { return kRules; }

const ElementRule* find_rule(std::string_view path) {
  if (is_foreign(path)) return &kForeign;
  for (std::string_view at = path; !at.empty(); at = parent_of(at)) {
    const auto own = std::ranges::find(kRules, at, &ElementRule::path);
    if (own != std::end(kRules)) return &*own;
    const bool splits = std::ranges::any_of(
        kRules, [&](const ElementRule& rule) { return is_below(rule.path, at); });
    // What is split into several is used itself; what is below it without a rule is unknown.
    if (splits) return nullptr;
  }
  return nullptr;
}

bool is_used(std::string_view path) {
  const bool splits = std::ranges::any_of(
      kRules, [&](const ElementRule& rule) { return is_below(rule.path, path); });
  if (splits) return true;
  const ElementRule* rule = find_rule(path);
  return rule != nullptr && !rule->verdict;
}

std::string tag(std::string_view name) { return std::string("<").append(name).append(">"); }

std::string allowed_beside(std::string_view path) {
  const std::string_view parent = parent_of(path);
  std::vector<std::string> names;
  for (const ElementRule& rule : kRules) {
    if (!is_below(rule.path, parent) || !is_used(rule.path)) continue;
    const std::string_view below = rule.path.substr(parent.size() + 1);
    const std::string name = tag(below.substr(0, below.find('/')));
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "allowed: " : ", ").append(name);
  return text.empty() ? tag(parent.substr(parent.rfind('/') + 1)) + " has no such element" : text;
}

}  // namespace hlm::ve
