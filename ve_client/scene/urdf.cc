#include "hlm/ve_client/scene/urdf.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <string_view>

#include "hlm/common/range.h"
#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/solid.h"

namespace hlm::ve {
namespace {

using tinyxml2::XMLElement;

constexpr const char* kWorldName = "world";
constexpr std::string_view kOtherEngine = "tunes another solver or engine";

/// Elements of URDF that SDFormat does not have, and what is said of them.
struct UrdfRule {
  std::string_view parent;
  std::string_view name;
  Verdict verdict = Verdict::kIgnored;
  std::string_view note;
};
constexpr UrdfRule kUrdfRules[] = {
    {"model", "transmission", Verdict::kIgnored, "joints have no motors"},
    {"model", "ros2_control", Verdict::kIgnored, "joints have no motors"},
    {"model", "sensor", Verdict::kIgnored, "no part in contact"},
    {"model", "material", Verdict::kIgnored, "no part in contact"},
    {"collision", "material", Verdict::kIgnored, "no part in contact"},
    {"joint", "calibration", Verdict::kIgnored, "joints have no motors"},
    {"joint", "safety_controller", Verdict::kApproximated, "only <limit> limits a joint"},
    {"joint", "mimic", Verdict::kApproximated, "the joint moves by itself"},
};

/// Children of <gazebo> that SDFormat has under the same name, in the element that is referred to.
constexpr std::string_view kOfGazebo[] = {"plugin", "sensor", "gravity", "self_collide", "static"};

std::string attribute(const XMLElement* element, const char* name) {
  const char* value = element != nullptr ? element->Attribute(name) : nullptr;
  return value != nullptr ? value : "";
}

/// The children of that name, or all: a list that stays while they are moved.
std::vector<XMLElement*> children(XMLElement& parent, const char* name = nullptr) {
  std::vector<XMLElement*> all;
  for (XMLElement* child = parent.FirstChildElement(name); child != nullptr;
       child = child->NextSiblingElement(name)) {
    all.push_back(child);
  }
  return all;
}

XMLElement& child_of(XMLElement& parent, const char* name) {
  XMLElement* child = parent.FirstChildElement(name);
  return child != nullptr ? *child : *parent.InsertNewChildElement(name);
}

void remove(XMLElement& element) { element.Parent()->DeleteChild(&element); }

void clear_attributes(XMLElement& element) {
  while (element.FirstAttribute() != nullptr) {
    element.DeleteAttribute(element.FirstAttribute()->Name());
  }
}

/// URDF's attributes are SDFormat's elements.
void attributes_to_children(XMLElement* element) {
  if (element == nullptr) return;
  for (const auto* each = element->FirstAttribute(); each != nullptr; each = each->Next()) {
    const std::string_view name = each->Name();
    XMLElement* child = element->InsertNewChildElement(name == "filename" ? "uri" : each->Name());
    child->SetText(each->Value());
  }
  clear_attributes(*element);
}

/// One attribute becomes the element's text.
void attribute_to_text(XMLElement* element, const char* name) {
  if (element == nullptr) return;
  const std::string value = attribute(element, name);
  clear_attributes(*element);
  element->SetText(value.c_str());
}

std::string numbers_of(const XMLElement* origin, const char* name) {
  const std::string value = attribute(origin, name);
  return value.empty() ? "0 0 0" : value;
}

/// Gives `element` the pose that <origin> has, in `frame`.
void set_pose(XMLElement& element, const XMLElement* origin, const std::string& frame) {
  const std::string pose = numbers_of(origin, "xyz") + " " + numbers_of(origin, "rpy");
  if (XMLElement* own = element.FirstChildElement("origin")) remove(*own);
  XMLElement& placed = child_of(element, "pose");
  if (!frame.empty()) placed.SetAttribute("relative_to", frame.c_str());
  placed.SetText(pose.c_str());
}

Vector3 vector_of(const XMLElement* origin, const char* name) {
  Vector3 v = Vector3::Zero();
  std::istringstream text(numbers_of(origin, name));
  text >> v.x() >> v.y() >> v.z();
  return v;
}

Pose pose_of(const XMLElement* origin) {
  const Vector3 angles = vector_of(origin, "rpy");
  return {vector_of(origin, "xyz"), Quaternion(Eigen::AngleAxisd(angles.z(), Vector3::UnitZ()) *
                                               Eigen::AngleAxisd(angles.y(), Vector3::UnitY()) *
                                               Eigen::AngleAxisd(angles.x(), Vector3::UnitX()))};
}

/// Mass (as `volume`), centre and inertia of a link, in its frame; none without <mass>, or if 0.
std::optional<Solid> mass_of(const XMLElement& link) {
  const XMLElement* inertial = link.FirstChildElement("inertial");
  if (inertial == nullptr) return std::nullopt;
  const auto number = [&](const char* element, const char* name) {
    const XMLElement* holder = inertial->FirstChildElement(element);
    return holder != nullptr ? holder->DoubleAttribute(name) : 0;
  };
  Solid mass{number("mass", "value"), Vector3::Zero(), Matrix3::Zero()};
  if (mass.volume == 0) return std::nullopt;
  const auto moment = [&](const char* name) { return number("inertia", name); };
  mass.moments << moment("ixx"), moment("ixy"), moment("ixz"), moment("ixy"), moment("iyy"),
      moment("iyz"), moment("ixz"), moment("iyz"), moment("izz");
  return moved(pose_of(inertial->FirstChildElement("origin")), mass);
}

void set_mass(XMLElement& link, const Solid& mass) {
  const auto set = [](XMLElement& parent, const char* name, double value) {
    child_of(parent, name).SetText(shortest_text(value).c_str());
  };
  if (XMLElement* old = link.FirstChildElement("inertial")) remove(*old);
  XMLElement& inertial = child_of(link, "inertial");
  set(inertial, "mass", mass.volume);
  const Vector3& p = mass.centre;
  child_of(inertial, "pose")
      .SetText((shortest_text(p.x()) + " " + shortest_text(p.y()) + " " + shortest_text(p.z()) +
                " 0 0 0")
                   .c_str());
  XMLElement& inertia = child_of(inertial, "inertia");
  constexpr const char* kAxes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      set(inertia, (std::string("i") + kAxes[i] + kAxes[j]).c_str(), mass.moments(i, j));
    }
  }
}

void set_friction(XMLElement& link, const char* name, const std::string& mu) {
  for (XMLElement* collision : children(link, "collision")) {
    XMLElement& friction = child_of(child_of(*collision, "surface"), "friction");
    child_of(child_of(friction, "ode"), name).SetText(mu.c_str());
  }
}

class Rewriter {
 public:
  Rewriter(SdfFile& file, Diagnostics& diagnostics)
      : file_(file), robot_(*file.root), diagnostics_(diagnostics) {}

  bool rewrite() {
    robot_.SetName("model");
    const std::string name = attribute(&robot_, "name");
    clear_attributes(robot_);  // Among them names of other programs.
    robot_.SetAttribute("name", name.empty() ? "robot" : name.c_str());
    if (!apply_rules(robot_) || !read_tree()) return false;
    for (XMLElement* gazebo : children(robot_, "gazebo")) extend(*gazebo);
    for (auto& [own, link] : links_) read_link(own, *link.element);
    for (XMLElement* link : children(robot_, "link")) merge(attribute(link, "name"));
    drop_empty_leaves();
    hold_root();
    for (XMLElement* link : children(robot_, "link")) write_link(*link);
    for (XMLElement* joint : children(robot_, "joint")) write_joint(*joint);
    return true;
  }

 private:
  struct Link {
    XMLElement* element = nullptr;
    XMLElement* joint = nullptr;  ///< The joint to its parent; null for the root.
    std::string parent;
    Pose X_PL;        ///< Pose in the parent.
    std::string top;  ///< The link that it is a part of, by fixed joints; mostly itself.
    std::optional<Solid> mass;
    bool merged = false;  ///< Other links are part of it, and `mass` has theirs.
  };

  void say(Verdict verdict, const XMLElement& element, const std::string& what) {
    if (verdict == Verdict::kRefused) diagnostics_.refuse(place_of(element, file_), what);
    if (verdict == Verdict::kApproximated) diagnostics_.approximate(place_of(element, file_), what);
    if (verdict == Verdict::kIgnored) diagnostics_.ignore(place_of(element, file_), what);
  }

  /// Takes out what has a rule, below links and joints too. False if xacro has to be run first.
  bool apply_rules(XMLElement& parent) {
    for (XMLElement* child : children(parent)) {
      const std::string_view name = child->Name();
      if (name.starts_with("xacro:")) {
        say(Verdict::kRefused, *child, tag(name) + " must be expanded: run xacro first");
        return false;
      }
      const auto rule = std::ranges::find_if(kUrdfRules, [&](const UrdfRule& each) {
        return each.parent == parent.Name() && each.name == name;
      });
      if (rule != std::end(kUrdfRules)) {
        say(rule->verdict, *child, tag(name) + ": " + std::string(rule->note));
        remove(*child);
      } else if ((name == "link" || name == "joint" || name == "collision") &&
                 !apply_rules(*child)) {
        return false;
      }
    }
    return true;
  }

  /// Finds the links, the joints to them and their root. False if they are no tree.
  bool read_tree() {
    for (XMLElement* link : children(robot_, "link")) {
      const std::string name = attribute(link, "name");
      if (name.empty() || links_.contains(name)) {
        say(Verdict::kRefused, *link,
            "<link> name '" + name + "' must not be empty, or another link's");
        return false;
      }
      links_[name].element = link;
    }
    for (XMLElement* joint : children(robot_, "joint")) {
      if (!read_joint(*joint)) return false;
    }
    std::string others;
    for (XMLElement* link : children(robot_, "link")) {
      const std::string name = attribute(link, "name");
      if (links_.at(name).joint != nullptr) continue;
      if (root_.empty()) {
        root_ = name;
      } else {
        others.append(" and '").append(name).append("'");
      }
    }
    if (links_.empty()) return true;  // Of which the model's own check has more to say.
    if (!others.empty()) {
      say(Verdict::kRefused, robot_,
          "links '" + root_ + "'" + others +
              " are no joint's child; one link must be the root of all");
      return false;
    }
    if (root_.empty() || !is_connected()) {
      say(Verdict::kRefused, robot_, "its joints form a loop; they must join the links to a tree");
      return false;
    }
    name_world();
    for (auto& [name, link] : links_) link.top = top_of(name);
    return true;
  }

  bool read_joint(XMLElement& joint) {
    const std::string type = attribute(&joint, "type");
    if (type == "floating" || type == "planar") {
      say(Verdict::kRefused, joint,
          "type '" + type +
              "' must be fixed, revolute, continuous or prismatic; put what moves freely into a "
              "file of its own");
      joint.SetAttribute("type", "continuous");
    }
    const std::string parent = attribute(joint.FirstChildElement("parent"), "link");
    const std::string child = attribute(joint.FirstChildElement("child"), "link");
    for (const std::string& end : {parent, child}) {
      if (links_.contains(end)) continue;
      say(Verdict::kRefused, joint, "joins a link '" + end + "', which the file does not have");
      return false;
    }
    Link& moved = links_.at(child);
    if (moved.joint != nullptr) {
      say(Verdict::kRefused, joint, "link '" + child + "' is the child of two joints");
      return false;
    }
    moved.joint = &joint;
    moved.parent = parent;
    moved.X_PL = pose_of(joint.FirstChildElement("origin"));
    return true;
  }

  /// Whether all links hang on the root, directly or by others.
  bool is_connected() const {
    std::set<std::string> hanging{root_};
    for (const auto& [name, link] : links_) {
      std::set<std::string> above;
      for (std::string at = name; !hanging.contains(at); at = links_.at(at).parent) {
        if (!above.insert(at).second) return false;
      }
      hanging.merge(above);
    }
    return true;
  }

  /// SDFormat has the name for the world alone. A root of this name is the world; it stays a link
  /// only if it has shapes, or if there is no other.
  void name_world() {
    const auto found = links_.find(kWorldName);
    if (found == links_.end()) return;
    Link world = found->second;
    links_.erase(found);
    is_world_ = root_ == kWorldName;
    const bool kept =
        !is_world_ || links_.empty() || world.element->FirstChildElement("collision") != nullptr;
    std::string name;
    if (kept) {
      for (name = "world_link"; links_.contains(name);) name += "_";
      world.element->SetAttribute("name", name.c_str());
      links_.emplace(name, world);
      if (world.joint != nullptr)
        world.joint->FirstChildElement("child")->SetAttribute("link", name.c_str());
    } else {
      remove(*world.element);
    }
    if (is_world_) root_ = name;
    for (auto& [own, link] : links_) {
      if (link.parent != kWorldName) continue;
      link.parent = name;
      if (kept) link.joint->FirstChildElement("parent")->SetAttribute("link", name.c_str());
    }
  }

  std::string top_of(const std::string& name) const {
    const Link& link = links_.at(name);
    const bool part = !link.parent.empty() && attribute(link.joint, "type") == "fixed";
    return part ? top_of(link.parent) : name;
  }

  /// What a file says for Gazebo of a link, a joint or all.
  void extend(XMLElement& gazebo) {
    const std::string reference = attribute(&gazebo, "reference");
    XMLElement* target = reference.empty() ? &robot_ : nullptr;
    if (links_.contains(reference)) target = links_.at(reference).element;
    for (XMLElement* joint : children(robot_, "joint")) {
      if (target == nullptr && attribute(joint, "name") == reference) target = joint;
    }
    for (XMLElement* child : children(gazebo)) {
      const std::string_view name = child->Name();
      const std::string text = child->GetText() != nullptr ? child->GetText() : "";
      const bool of_link = target != nullptr && std::string_view(target->Name()) == "link";
      if (of_link && (name == "mu1" || name == "mu2")) {
        set_friction(*target, name == "mu1" ? "mu" : "mu2", text);
      } else if (of_link && name == "turnGravityOff") {
        child_of(*target, "gravity").SetText(text != "true" && text != "1");
      } else if (target != nullptr && std::ranges::count(kOfGazebo, name) > 0) {
        target->InsertEndChild(child);
      } else {
        const bool seen = name == "material" || name == "visual";
        say(Verdict::kIgnored, gazebo,
            tag(name) + " of <gazebo>: " +
                std::string(seen ? std::string_view("no part in contact") : kOtherEngine));
      }
    }
    remove(gazebo);
  }

  /// Names the link's collisions, and takes its mass and what a file says for Bullet.
  void read_link(const std::string& name, XMLElement& element) {
    if (XMLElement* contact = element.FirstChildElement("contact")) {
      if (const XMLElement* friction = contact->FirstChildElement("lateral_friction")) {
        set_friction(element, "mu", attribute(friction, "value"));
      }
      for (const XMLElement* other : children(*contact)) {
        if (std::string_view(other->Name()) == "lateral_friction") continue;
        say(Verdict::kIgnored, *other, tag(other->Name()) + ": " + std::string(kOtherEngine));
      }
      remove(*contact);
    }
    int number = 0;
    for (XMLElement* collision : children(element, "collision")) {
      const std::string count = number > 0 ? "_" + std::to_string(number) : "";
      ++number;
      if (!attribute(collision, "name").empty()) continue;
      collision->SetAttribute("name", (name + "_collision" + count).c_str());
    }
    Link& link = links_.at(name);
    link.mass = mass_of(element);
    XMLElement* inertial = element.FirstChildElement("inertial");
    if (link.mass || inertial == nullptr) return;
    const XMLElement* inertia = inertial->FirstChildElement("inertia");
    const auto turns = [&](const char* moment) { return inertia->DoubleAttribute(moment) != 0; };
    if (inertia != nullptr && (turns("ixx") || turns("iyy") || turns("izz"))) {
      say(Verdict::kApproximated, *inertia,
          "<inertia> without mass is not read; give the link a <mass>");
    }
    remove(*inertial);
  }

  /// Makes a link part of the one that carries it, and a frame of its own place there.
  void merge(const std::string& name) {
    const Link& part = links_.at(name);
    if (part.top == name) return;
    Link& whole = links_.at(part.top);
    if (part.mass) {
      Pose X_TL;
      for (const Link* at = &part; at != &whole; at = &links_.at(at->parent)) {
        X_TL = at->X_PL * X_TL;
      }
      const Solid mass = moved(X_TL, *part.mass);
      whole.mass = whole.mass ? together(*whole.mass, mass) : mass;
      whole.merged = true;
    }
    for (XMLElement* child : children(*part.element)) {
      if (std::string_view(child->Name()) == "inertial") continue;
      // A copy has no line of its own: those of what follows are counted from the last one.
      XMLElement* copy = child->DeepClone(file_.document.get())->ToElement();
      whole.element->InsertEndChild(copy);
      const std::string_view type = copy->Name();
      if (type == "collision") set_pose(*copy, copy->FirstChildElement("origin"), name);
    }
    XMLElement& frame = *part.joint;
    const XMLElement* origin = frame.FirstChildElement("origin");
    set_pose(frame, origin, part.parent);
    for (XMLElement* child : children(frame)) {
      if (std::string_view(child->Name()) != "pose") remove(*child);
    }
    clear_attributes(frame);
    frame.SetName("frame");
    frame.SetAttribute("name", name.c_str());
    frame.SetAttribute("attached_to", part.parent.c_str());
    remove(*part.element);
  }

  /// Links that weigh nothing, touch nothing and carry nothing.
  void drop_empty_leaves() {
    std::map<std::string, int> carried;  // By each link, joints that are not its own parts'.
    for (const auto& [name, link] : links_) {
      if (link.top == name && !link.parent.empty()) ++carried[links_.at(link.parent).top];
    }
    for (const XMLElement* element : children(robot_, "link")) {
      std::string name = attribute(element, "name");
      while (links_.contains(name) && carried[name] == 0 && is_empty(links_.at(name))) {
        const std::string parent = links_.at(name).parent;
        drop(name);
        if (parent.empty()) break;
        name = links_.at(parent).top;
        --carried[name];
      }
    }
  }

  bool is_empty(const Link& link) const {
    return !link.mass && link.joint != nullptr &&
           link.element->FirstChildElement("collision") == nullptr;
  }

  void drop(const std::string& name) {
    const Link& link = links_.at(name);
    say(Verdict::kIgnored, *link.element,
        "a link without mass and shapes is left out where it carries no other");
    for (XMLElement* frame : children(robot_, "frame")) {
      if (links_.at(attribute(frame, "name")).top == name) remove(*frame);
    }
    remove(*link.joint);
    remove(*link.element);
    std::erase_if(links_, [&](const auto& each) { return each.second.top == name; });
  }

  /// Fixes a root that is the world, or has no mass, to the world.
  void hold_root() {
    if (root_.empty()) return;
    const Link& root = links_.at(root_);
    if (root.mass && !is_world_) return;
    if (!is_world_) {
      say(Verdict::kApproximated, *root.element,
          "a root without mass is fixed to the world, as in other engines of URDF");
    }
    XMLElement* joint = robot_.InsertNewChildElement("joint");
    std::string own = "fixed_to_world";
    for (const XMLElement* other : children(robot_, "joint")) {
      if (attribute(other, "name") == own) own += "_";
    }
    joint->SetAttribute("name", own.c_str());
    joint->SetAttribute("type", "fixed");
    joint->InsertNewChildElement("parent")->SetAttribute("link", kWorldName);
    joint->InsertNewChildElement("child")->SetAttribute("link", root_.c_str());
  }

  void write_link(XMLElement& element) {
    const std::string name = attribute(&element, "name");
    const Link& link = links_.at(name);
    if (link.joint != nullptr) {
      set_pose(element, link.joint->FirstChildElement("origin"), link.parent);
    }
    if (link.merged) {
      set_mass(element, *link.mass);
    } else if (XMLElement* inertial = element.FirstChildElement("inertial")) {
      set_pose(*inertial, inertial->FirstChildElement("origin"), "");
      attribute_to_text(inertial->FirstChildElement("mass"), "value");
      attributes_to_children(inertial->FirstChildElement("inertia"));
    }
    std::set<std::string> names;
    for (XMLElement* collision : children(element, "collision")) {
      std::string own = attribute(collision, "name");
      while (!names.insert(own).second) own += "_";
      collision->SetAttribute("name", own.c_str());
      if (const XMLElement* origin = collision->FirstChildElement("origin")) {
        set_pose(*collision, origin, "");
      }
      XMLElement* geometry = collision->FirstChildElement("geometry");
      if (geometry == nullptr) continue;
      for (XMLElement* shape : children(*geometry)) {
        attributes_to_children(shape);
        XMLElement* scale = shape->FirstChildElement("scale");
        const std::string factor =
            scale != nullptr && scale->GetText() != nullptr ? scale->GetText() : "";
        if (!factor.empty() && factor.find(' ') == factor.npos) {  // One for all, as Bullet has it.
          scale->SetText((factor + " " + factor + " " + factor).c_str());
        }
      }
    }
  }

  void write_joint(XMLElement& joint) {
    attribute_to_text(joint.FirstChildElement("parent"), "link");
    attribute_to_text(joint.FirstChildElement("child"), "link");
    if (XMLElement* origin = joint.FirstChildElement("origin")) remove(*origin);  // Its child's.
    const std::string type = attribute(&joint, "type");
    if (type == "spherical") joint.SetAttribute("type", "ball");  // Bullet's.
    if (type == "fixed" || type == "spherical") {
      for (const char* name : {"axis", "limit", "dynamics"}) {
        if (XMLElement* unused = joint.FirstChildElement(name)) remove(*unused);
      }
      return;
    }
    const bool turns_on = type == "continuous";
    if (joint.FirstChildElement("axis") == nullptr)
      child_of(joint, "axis").SetAttribute("xyz", "1 0 0");
    XMLElement& axis = *joint.FirstChildElement("axis");
    joint.InsertEndChild(&axis);
    attributes_to_children(&axis);
    for (const char* name : {"limit", "dynamics"}) {
      XMLElement* part = joint.FirstChildElement(name);
      if (part == nullptr) continue;
      for (const char* end : {"lower", "upper"}) {
        if (std::string_view(name) != "limit") continue;
        if (turns_on) part->DeleteAttribute(end);
        if (!turns_on && part->Attribute(end) == nullptr) part->SetAttribute(end, 0);
      }
      attributes_to_children(part);
      axis.InsertEndChild(part);
    }
  }

  SdfFile& file_;
  XMLElement& robot_;
  Diagnostics& diagnostics_;
  std::map<std::string, Link> links_;
  std::string root_;  ///< Empty: it is the world, which is no link here.
  bool is_world_ = false;
};

}  // namespace

bool rewrite_urdf(SdfFile& file, Diagnostics& diagnostics) {
  return Rewriter(file, diagnostics).rewrite();
}

}  // namespace hlm::ve
