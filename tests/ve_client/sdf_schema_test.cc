// Of everything that SDFormat allows in a model, something is made, or it is named: nothing is
// dropped in silence.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include <sdf/SDFImpl.hh>
#include <sdf/parser.hh>
#include <unistd.h>

#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/sdf_loader.h"
#include "tests/support/catch.h"
#include "tests/support/png.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

// A world around one element.

/// The elements in an element, by name, as the world has them.
using Children = std::map<std::string, std::string>;

const std::string kMesh = std::string(HLM_TEST_WORLDS) + "/meshes/";
/// Gone after the test that writes it.
const fs::path kFolder = fs::temp_directory_path() / ("schema_" + std::to_string(::getpid()));
const std::string kBase =
    "<link name='base'><pose>1 0 0 0 0 1</pose><inertial><mass>1</mass><inertia><ixx>0.01</ixx>"
    "<iyy>0.01</iyy><izz>0.01</izz></inertia></inertial></link>";

/// What stands beside the element whose path is given.
Children children_of(const std::string& parent, const std::string& path) {
  const bool in_world_frame = path.starts_with("world/frame");
  const bool still = path.find("/plane") != path.npos || path.find("/heightmap") != path.npos;
  static const std::map<std::string, Children> kChildren{
      {"world/physics", {}},
      {"world/frame", {{"pose", "<pose>0 0 1 0 0 0</pose>"}}},
      {"model/frame", {{"pose", "<pose>0 0 1 0 0 0</pose>"}}},
      {"model/link/inertial",
       {{"mass", "<mass>1</mass>"},
        {"inertia", "<inertia><ixx>0.01</ixx><iyy>0.012</iyy><izz>0.015</izz></inertia>"}}},
      {"model/link/inertial/inertia",
       {{"ixx", "<ixx>0.01</ixx>"}, {"iyy", "<iyy>0.01</iyy>"}, {"izz", "<izz>0.015</izz>"}}},
      {"model/link/collision",
       {{"geometry", "<geometry><box><size>1 1 1</size></box></geometry>"}}},
      {"model/link/collision/geometry/mesh", {{"uri", "<uri>" + kMesh + "two_parts.obj</uri>"}}},
      {"model/link/collision/geometry/heightmap",
       {{"uri", "<uri>" + (kFolder / "a.png").string() + "</uri>"}}},
      {"model/link/collision/geometry/mesh/submesh", {{"name", "<name>small</name>"}}},
      {"model/joint",
       {{"parent", "<parent>base</parent>"},
        {"child", "<child>l</child>"},
        {"axis", "<axis><xyz>0 0 1</xyz></axis>"}}},
      {"model/joint/axis",
       {{"xyz", "<xyz>0 0 1</xyz>"}, {"limit", "<limit><lower>-1</lower></limit>"}}},
      {"model/joint/axis/dynamics",
       {{"spring_stiffness", "<spring_stiffness>1</spring_stiffness>"}}},
  };
  if (parent == "world") {
    return {{"model", "<model name='m'><pose relative_to='" +
                          std::string(in_world_frame ? "f" : "") + "'/>" + kBase + "</model>"}};
  }
  if (parent == "model") {
    Children children{
        {"base", kBase},
        {"link", path.starts_with("model/frame") ? "<link name='l'><pose relative_to='f'/></link>"
                                                 : "<link name='l'/>"}};
    children["static"] = still ? "<static>true</static>" : "";
    return children;
  }
  const auto known = kChildren.find(parent);
  return known == kChildren.end() ? Children{} : known->second;
}

std::string attributes_of(const std::string& path) {
  const std::string name = path.substr(path.rfind('/') + 1);
  if (path == "model") return "name='m'";
  if (name == "link") return "name='l'";
  if (name == "collision") return "name='c'";
  if (name == "frame") return "name='f'";
  if (path == "model/joint") return "name='j' type='revolute'";
  return "";
}

std::string element(const std::string& path, const std::string& attributes,
                    const Children& children) {
  const std::string name = path.substr(path.rfind('/') + 1);
  std::string text = "<" + name + " " + attributes + ">";
  for (const auto& [key, child] : children) text += child;
  return text + "</" + name + ">";
}

/// The file in which the element at `path` is `text`.
std::string file_with(const std::string& path, const std::string& text) {
  std::string inner = text;
  std::string at = path;
  for (std::size_t slash = at.rfind('/'); slash != at.npos; slash = at.rfind('/')) {
    const std::string name = at.substr(slash + 1);
    at.erase(slash);
    Children children = children_of(at, path);
    children[name] = inner;
    inner = element(at, attributes_of(at), children);
  }
  if (at == "model")
    inner =
        "<world name='w'><frame name='wf'><pose>0 0 3 0 0 0</pose></frame>" + inner + "</world>";
  return "<sdf version='1.9'>" + inner + "</sdf>";
}

/// Everything of a world that the engine sees.
std::string text_of(const WorldDescription& world) {
  std::ostringstream out;
  const auto pose = [&](const Pose& X) {
    out << X.p.transpose() << " " << X.R.coeffs().transpose() << ";";
  };
  out << world.gravity_W.transpose() << " " << world.solver.largest_step.value_or(0) << " "
      << world.solver.sweeps.value_or(0) << "\n";
  for (const ModelDescription& model : world.models) {
    out << model.name << model.fixed;
    pose(model.X_WM);
  }
  for (const BodyDescription& body : world.bodies) {
    out << body.name << body.fixed << body.weightless << body.mass << " " << body.I_B;
    pose(body.X_WB);
    for (const CollisionDescription& collision : body.collisions) {
      out << collision.name << collision.friction.value_or(-1) << collision.shape.index();
      pose(collision.X_BG);
      const auto sizes = [&](const auto& shape) {
        using Each = std::decay_t<decltype(shape)>;
        if constexpr (std::is_same_v<Each, Hull>) {
          for (const Vector3& p : shape.vertices) out << p.transpose() << ",";
        } else if constexpr (std::is_same_v<Each, Box>) {
          out << shape.size.transpose();
        } else if constexpr (std::is_same_v<Each, Ellipsoid>) {
          out << shape.radii.transpose();
        } else if constexpr (std::is_same_v<Each, Sphere>) {
          out << shape.radius;
        } else if constexpr (!std::is_same_v<Each, HalfSpace>) {
          out << shape.radius << " " << shape.length;
        }
      };
      std::visit(sizes, collision.shape);
    }
  }
  for (const JointDescription& joint : world.joints) {
    out << joint.name << static_cast<int>(joint.type) << joint.parent << joint.child << " "
        << joint.axis_J.transpose() << " " << joint.lower << " " << joint.upper << " "
        << joint.stiffness << " " << joint.rest << " " << joint.damping;
    pose(joint.X_WJ);
  }
  return out.str();
}

struct Outcome {
  std::string world;
  Diagnostics diagnostics;

  bool names(const std::string& word) const {
    return std::ranges::any_of(diagnostics.findings(), [&](const Finding& finding) {
      return to_string(finding).find(word) != std::string::npos;
    });
  }
  std::string said() const {
    std::string text;
    for (const Finding& finding : diagnostics.findings()) text += to_string(finding) + "\n";
    return text;
  }
};

Outcome outcome_of(const std::string& file) {
  Outcome outcome;
  outcome.world = text_of(parse_world(file, "test.sdf", outcome.diagnostics));
  return outcome;
}

// What is read.

/// Two values of something that is read: each makes another world, the first one usable. Of an
/// attribute of an element without a value of its own: two lists of attributes.
struct Sample {
  std::string one;
  std::string other;
};

void add_pose(std::map<std::string, Sample>& samples, const std::string& path,
              const std::string& frame) {
  const auto pose = [](const std::string& attributes, const std::string& text) {
    return "<pose " + attributes + ">" + text + "</pose>";
  };
  samples[path] = {pose("", "0 0 0 0 0 0"), pose("", "0 0.5 0 0 0 0.3")};
  samples[path + "@degrees"] = {pose("", "0 1 0 0 0 1"), pose("degrees='true'", "0 1 0 0 0 1")};
  samples[path + "@rotation_format"] = {pose("", "0 1 0 0 0 1"),
                                        pose("rotation_format='quat_xyzw'", "0 1 0 0 0 1 1")};
  if (!frame.empty()) {
    samples[path + "@relative_to"] = {pose("", "0 0 0 0 0 0"),
                                      pose("relative_to='" + frame + "'", "0 0 0 0 0 0")};
  }
}

std::string in(const std::string& name, const std::string& text) {
  return "<" + name + ">" + text + "</" + name + ">";
}

std::map<std::string, Sample> samples() {
  std::map<std::string, Sample> samples;
  const auto add = [&](const std::string& path, const std::string& one, const std::string& other) {
    const std::string name = path.substr(path.rfind('/') + 1);
    samples[path] = {in(name, one), in(name, other)};
  };
  add("world/gravity", "0 0 -9", "0 0 -1");
  add("world/physics/max_step_size", "0.001", "0.002");
  add("world/physics/ode/solver/iters", "50", "60");
  add_pose(samples, "world/frame/pose", "m");
  samples["world/frame/pose@relative_to"].other = "<pose relative_to='nowhere'/>";
  samples["world/frame@name"] = {"name='f'", "name='g'"};
  samples["world/frame@attached_to"] = {"name='f'", "name='f' attached_to='nowhere'"};

  samples["model@name"] = {"name='m'", "name='n'"};
  samples["model@canonical_link"] = {"name='m' canonical_link='l'",
                                     "name='m' canonical_link='nowhere'"};
  samples["model@placement_frame"] = {"name='m'", "name='m' placement_frame='base'"};
  add("model/static", "false", "true");
  samples["model/frame@name"] = {"name='f'", "name='g'"};
  samples["model/frame@attached_to"] = {"name='f'", "name='f' attached_to='base'"};
  add_pose(samples, "model/frame/pose", "base");
  add_pose(samples, "model/pose", "wf");

  samples["model/link@name"] = {"name='l'", "name='k'"};
  add("model/link/gravity", "true", "false");
  add("model/link/kinematic", "false", "true");
  add_pose(samples, "model/link/pose", "base");
  add("model/link/inertial/mass", "1", "2");
  add_pose(samples, "model/link/inertial/pose", "");
  add("model/link/inertial/inertia/ixx", "0.01", "0.012");
  add("model/link/inertial/inertia/ixy", "0", "0.001");
  add("model/link/inertial/inertia/ixz", "0", "0.001");
  add("model/link/inertial/inertia/iyy", "0.01", "0.012");
  add("model/link/inertial/inertia/iyz", "0", "0.001");
  add("model/link/inertial/inertia/izz", "0.01", "0.012");

  const std::string collision = "model/link/collision";
  samples[collision + "@name"] = {"name='c'", "name='d'"};
  add_pose(samples, collision + "/pose", "base");
  const std::string geometry = collision + "/geometry/";
  add(geometry + "box/size", "1 1 1", "1 2 1");
  add(geometry + "capsule/radius", "1", "2");
  add(geometry + "capsule/length", "1", "2");
  add(geometry + "cylinder/radius", "1", "2");
  add(geometry + "cylinder/length", "1", "2");
  add(geometry + "ellipsoid/radii", "1 1 1", "1 2 1");
  add(geometry + "sphere/radius", "1", "2");
  add(geometry + "plane/normal", "0 0 1", "0 1 0");
  add(geometry + "plane/size", "1 1", "2 2");  // It is named.
  add(geometry + "mesh/uri", kMesh + "two_parts.obj", kMesh + "inside_out.obj");
  add(geometry + "mesh/scale", "1 1 1", "1 2 1");
  add(geometry + "mesh/submesh/name", "small", "large");
  add(geometry + "mesh/submesh/center", "false", "true");
  add(geometry + "heightmap/uri", kFolder / "a.png", kFolder / "b.png");
  add(geometry + "heightmap/size", "1 1 1", "1 2 1");
  add(geometry + "heightmap/pos", "0 0 0", "0 0 1");
  add(collision + "/surface/friction/ode/mu", "1", "0.5");

  samples["model/joint@name"] = {"name='j' type='revolute'", "name='i' type='revolute'"};
  samples["model/joint@type"] = {"name='j' type='revolute'", "name='j' type='prismatic'"};
  add("model/joint/parent", "base", "world");
  add("model/joint/child", "l", "nowhere");
  add_pose(samples, "model/joint/pose", "base");
  add("model/joint/axis/xyz", "0 0 1", "0 1 0");
  samples["model/joint/axis/xyz@expressed_in"] = {"<xyz>1 0 0</xyz>",
                                                  "<xyz expressed_in='base'>1 0 0</xyz>"};
  add("model/joint/axis/limit/lower", "-1", "-2");
  add("model/joint/axis/limit/upper", "1", "2");
  add("model/joint/axis/dynamics/damping", "0", "1");
  add("model/joint/axis/dynamics/spring_stiffness", "0", "1");
  add("model/joint/axis/dynamics/spring_reference", "0", "0.5");
  return samples;
}

/// The images of the heightmaps.
void write_heights() {
  fs::create_directories(kFolder);
  const std::vector<std::uint8_t> a{0, 255, 0, 255};
  const std::vector<std::uint8_t> b{0, 0, 255, 255};
  test::write_png(kFolder / "a.png", 2, 2, a);
  test::write_png(kFolder / "b.png", 2, 2, b);
}

/// Attributes that nothing depends on: names of what there is one of, and of another engine.
const std::set<std::string> kFree{"world@name", "world/physics@name", "world/physics@default",
                                  "world/physics@type"};

// The format.

using Visit = std::function<void(const sdf::ElementPtr& description, const std::string& path)>;

/// Each element that the installed format allows in a used one, and the used ones themselves.
void walk(const sdf::ElementPtr& description, const std::string& path, const Visit& visit) {
  visit(description, path);
  if (!is_used(path)) return;
  for (unsigned i = 0; i < description->GetElementDescriptionCount(); ++i) {
    const sdf::ElementPtr child = description->GetElementDescription(i);
    if (child->GetName() == "model" || child->GetName() == "include") continue;
    walk(child, path + "/" + child->GetName(), visit);
  }
}

void walk(const Visit& visit) {
  const auto format = std::make_shared<sdf::SDF>();
  sdf::init(format);
  for (const std::string top : {"world", "model"}) {
    walk(format->Root()->GetElementDescription(top), top, visit);
  }
}

/// An element with all its attributes, its default value and what must be in it.
std::string instance_of(const sdf::ElementPtr& description) {
  std::string text = "<" + description->GetName();
  for (const sdf::ParamPtr& attribute : description->GetAttributes()) {
    const std::string value = attribute->GetDefaultAsString();
    text += " " + attribute->GetKey() + "='" + (value == "__default__" ? "x" : value) + "'";
  }
  text += ">";
  if (const sdf::ParamPtr value = description->GetValue()) text += value->GetDefaultAsString();
  for (unsigned i = 0; i < description->GetElementDescriptionCount(); ++i) {
    const sdf::ElementPtr child = description->GetElementDescription(i);
    if (child->GetRequired() == "1" || child->GetRequired() == "+") text += instance_of(child);
  }
  return text + "</" + description->GetName() + ">";
}

TEST_CASE("Every value and attribute of SDFormat that counts as read changes the world") {
  write_heights();
  const std::map<std::string, Sample> all = samples();
  std::set<std::string> unread;
  for (const auto& [key, sample] : all) unread.insert(key);
  const auto check = [&](const std::string& key, const std::string& path, bool as_attributes) {
    if (kFree.contains(key)) return;
    CAPTURE(key);
    const auto sample = all.find(key);
    if (sample == all.end()) FAIL_CHECK("no sample says what it changes");
    if (sample == all.end()) return;
    unread.erase(key);
    const auto outcome = [&](const std::string& text) {
      return outcome_of(
          file_with(path, as_attributes ? element(path, text, children_of(path, path)) : text));
    };
    const Outcome one = outcome(sample->second.one);
    const Outcome other = outcome(sample->second.other);
    CAPTURE(one.said(), other.said());
    CHECK(one.diagnostics.usable());
    CHECK((one.world != other.world || !other.diagnostics.usable() ||
           other.names("<" + path.substr(path.rfind('/') + 1) + ">: ")));
  };
  walk([&](const sdf::ElementPtr& description, const std::string& path) {
    if (!is_used(path)) return;
    const bool has_value = description->GetValue() != nullptr;
    if (has_value) check(path, path, false);
    for (const sdf::ParamPtr& attribute : description->GetAttributes()) {
      check(path + "@" + attribute->GetKey(), path, !has_value);
    }
  });
  CAPTURE(unread);
  CHECK(unread.empty());
  fs::remove_all(kFolder);
}

TEST_CASE("Every element of SDFormat that is not read is named by the check") {
  int count = 0;
  walk([&](const sdf::ElementPtr& description, const std::string& path) {
    if (is_used(path)) return;
    const std::string file = file_with(path, instance_of(description));
    const Outcome outcome = outcome_of(file);
    CAPTURE(path, file, outcome.said());
    CHECK(outcome.names("<" + description->GetName() + ">"));
    ++count;
  });
  CHECK(count > 80);
}

TEST_CASE("What SDFormat does not have is named, an element or an attribute in any that is read") {
  walk([&](const sdf::ElementPtr& description, const std::string& path) {
    if (!is_used(path)) return;
    const bool has_value = description->GetValue() != nullptr;
    CAPTURE(path);
    const std::string name = description->GetName();
    const std::string value = has_value ? description->GetValue()->GetDefaultAsString() : "";
    const Outcome attribute =
        outcome_of(file_with(path, has_value ? "<" + name + " odd='1'>" + value + "</" + name + ">"
                                             : element(path, attributes_of(path) + " odd='1'",
                                                       children_of(path, path))));
    CHECK(attribute.names("<" + name + "> attribute odd '1' is not read"));
    if (has_value) return;
    CHECK(outcome_of(file_with(path + "/odd", "<odd>1</odd>")).names("<odd>"));
  });
}

TEST_CASE("Of what may stand once a second one is named") {
  walk([&](const sdf::ElementPtr& description, const std::string& path) {
    const std::string required = description->GetRequired();
    if (!is_used(path) || path.find('/') == path.npos || (required != "0" && required != "1"))
      return;
    CAPTURE(path);
    const std::string once = instance_of(description);
    const Outcome outcome = outcome_of(file_with(path, once + once));
    CAPTURE(outcome.said());
    CHECK(outcome.names("second <" + description->GetName() + ">"));
  });
}

TEST_CASE("Of two shapes in one geometry the one that is not used is named") {
  const Outcome outcome = outcome_of(
      file_with("model/link/collision/geometry",
                "<geometry><box><size>1 1 1</size></box><sphere><radius>1</radius></sphere>"
                "</geometry>"));
  CHECK(outcome.names("<sphere>"));
  CHECK(outcome.diagnostics.usable());
}

}  // namespace
}  // namespace hlm::ve
