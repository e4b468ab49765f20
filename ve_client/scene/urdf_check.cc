#include "hlm/scene/urdf_check.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <string_view>

#include "hlm/common/range.h"
#include "hlm/scene/sdf_elements.h"

namespace hlm::ve {
namespace {

using tinyxml2::XMLElement;

/// libsdformat takes URDF masses up to 1e-6 kg for none, and leaves the link out with all that
/// hangs on it.
constexpr double kLeastUrdfMass = 1.1e-6;

/// Makes of a URDF link's <inertial> what the translation to SDF bears. Whether it can.
bool mend_inertial(XMLElement& link, const SdfFile& file, Diagnostics& diagnostics) {
  XMLElement* inertial = link.FirstChildElement("inertial");
  XMLElement* mass = inertial != nullptr ? inertial->FirstChildElement("mass") : nullptr;
  double value = 0;
  if (mass == nullptr || mass->QueryDoubleAttribute("value", &value) != tinyxml2::XML_SUCCESS) {
    return true;
  }
  const auto what = [&] { return "<mass> " + shortest_text(value) + " kg "; };
  if (value == 0) {
    const XMLElement* inertia = inertial->FirstChildElement("inertia");
    const bool turns = inertia != nullptr && (inertia->DoubleAttribute("ixx") != 0 ||
                                              inertia->DoubleAttribute("iyy") != 0 ||
                                              inertia->DoubleAttribute("izz") != 0);
    if (turns) {
      diagnostics.approximate(place_of(*inertia, file),
                              "<inertia> without mass is not read; give the link a <mass>");
    }
    // Two of these in one would have their centre of mass at 0/0.
    link.DeleteChild(inertial);
  } else if (!std::isfinite(value) || (value < 0 && value > -kLeastUrdfMass)) {
    diagnostics.refuse(place_of(*mass, file), what() + "must be above 0 and finite");
    return false;
  } else if (value > 0 && value < kLeastUrdfMass) {
    diagnostics.approximate(
        place_of(*mass, file),
        what() + "counts as " + shortest_text(kLeastUrdfMass) + " kg, the least of a URDF link");
    mass->SetAttribute("value", kLeastUrdfMass);
  }
  return true;
}

bool is_massless(const XMLElement& urdf_link) {
  const XMLElement* inertial = urdf_link.FirstChildElement("inertial");
  const XMLElement* mass = inertial != nullptr ? inertial->FirstChildElement("mass") : nullptr;
  return mass == nullptr || mass->DoubleAttribute("value") == 0;
}

/// What the translation of URDF drops in silence, and what is said of it.
struct UrdfRule {
  std::string_view parent;
  std::string_view name;
  Verdict verdict = Verdict::kIgnored;
  std::string_view note;
};
constexpr UrdfRule kUrdfRules[] = {
    {"robot", "transmission", Verdict::kIgnored, "joints have no motors"},
    {"robot", "ros2_control", Verdict::kIgnored, "joints have no motors"},
    {"robot", "sensor", Verdict::kIgnored, "no part in contact"},
    {"joint", "calibration", Verdict::kIgnored, "joints have no motors"},
    {"joint", "safety_controller", Verdict::kApproximated, "only <limit> limits a joint"},
    {"joint", "mimic", Verdict::kApproximated, "the joint moves by itself"},
};

bool is_translated(std::string_view parent, std::string_view name) {
  constexpr std::string_view kRobot[] = {"link", "joint", "material", "gazebo"};
  constexpr std::string_view kLink[] = {"inertial", "visual", "collision"};
  constexpr std::string_view kJoint[] = {"origin", "parent", "child", "axis", "limit", "dynamics"};
  const auto has = [&](const auto& names) {
    return std::ranges::find(names, name) != std::end(names);
  };
  if (parent == "robot") return has(kRobot);
  return parent == "link" ? has(kLink) : has(kJoint);
}

/// Says which children of a <robot>, <link> or <joint> are dropped.
void check_urdf_children(const XMLElement& parent, const SdfFile& file, Diagnostics& diagnostics) {
  for (const XMLElement* child = parent.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    const std::string_view name = child->Name();
    if (is_translated(parent.Name(), name) || name.find(':') != name.npos) continue;
    const auto rule = std::ranges::find_if(kUrdfRules, [&](const UrdfRule& each) {
      return each.parent == parent.Name() && each.name == name;
    });
    if (rule == std::end(kUrdfRules)) {
      diagnostics.approximate(
          place_of(*child, file),
          tag(name) + " is not known in " + tag(parent.Name()) + " of a URDF file, and not read");
    } else if (rule->verdict == Verdict::kIgnored) {
      diagnostics.ignore(place_of(*child, file), tag(name) + ": " + std::string(rule->note));
    } else {
      diagnostics.approximate(place_of(*child, file), tag(name) + ": " + std::string(rule->note));
    }
  }
}

void check_urdf_joint(const XMLElement& joint, const SdfFile& file, Diagnostics& diagnostics) {
  const char* type = joint.Attribute("type");
  if (type == nullptr) return;
  if (std::string_view(type) != "floating" && std::string_view(type) != "planar") return;
  diagnostics.refuse(place_of(joint, file),
                     std::string("type '") + type +
                         "' must be fixed, revolute, continuous or prismatic; put what moves "
                         "freely into a file of its own");
}

/// The link that a joint of a URDF file names as its "parent" or "child".
std::string_view end_of(const XMLElement& joint, const char* end) {
  const XMLElement* element = joint.FirstChildElement(end);
  const char* link = element != nullptr ? element->Attribute("link") : nullptr;
  return link != nullptr ? link : "";
}

/// Whether a link is left out for want of mass, and others with it: no fixed joint makes it part of
/// another, and a joint hangs something on it.
bool drops_others(const XMLElement& link, const SdfFile& file) {
  const char* given = link.Attribute("name");
  const std::string_view name = given != nullptr ? given : "";
  if (!is_massless(link) || name == "world") return false;
  bool carries = false;
  for (const XMLElement* joint = file.root->FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    const bool is_parent = end_of(*joint, "parent") == name;
    if (!is_parent && end_of(*joint, "child") != name) continue;
    const char* type = joint->Attribute("type");
    if (type != nullptr && std::string_view(type) == "fixed") return false;
    carries = carries || is_parent;
  }
  return carries;
}

}  // namespace

bool check_urdf(const SdfFile& file, Diagnostics& diagnostics) {
  bool possible = true;
  check_urdf_children(*file.root, file, diagnostics);
  for (XMLElement* child = file.root->FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    const std::string_view name = child->Name();
    if (name.starts_with("xacro:")) {
      diagnostics.refuse(place_of(*child, file), tag(name) + " must be expanded: run xacro first");
      return false;
    }
    if (name == "link" || name == "joint") check_urdf_children(*child, file, diagnostics);
    if (name == "joint") check_urdf_joint(*child, file, diagnostics);
    if (name == "link") possible = mend_inertial(*child, file, diagnostics) && possible;
    if (name == "link" && drops_others(*child, file)) {
      diagnostics.approximate(place_of(*child, file),
                              "a link without mass is left out, with all links that hang on it, as "
                              "in Gazebo; give it a <mass>");
    }
    if (name == "link" && child->FirstChildElement("collision") != nullptr && is_massless(*child)) {
      diagnostics.approximate(place_of(*child, file),
                              "a link without mass is left out, as in Gazebo, unless a fixed joint "
                              "joins it to one that has mass");
    }
  }
  return possible;
}

}  // namespace hlm::ve
