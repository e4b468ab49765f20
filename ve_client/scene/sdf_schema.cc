#include "hlm/ve_client/scene/sdf_schema.h"

#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include <sdf/SDFImpl.hh>
#include <sdf/parser.hh>

#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/sdf_places.h"

namespace hlm::ve {
namespace {

using sdf::ElementPtr;

/// Sizes and positions beyond this, m, are mistakes, and would carry the engine to infinity.
constexpr double kLargest = 1e6;

struct Schema {
  ElementPtr root;
  std::map<std::string, std::string> types;  ///< Types of the values, by path.
};

ElementPtr make_element(const std::string& name, const std::string& required) {
  auto element = std::make_shared<sdf::Element>();
  element->SetName(name);
  element->SetRequired(required);
  return element;
}

/// Those of another file, and those that a schema without end would have.
bool is_cut(const std::string& name) { return name == "model" || name == "include"; }

/// What is used of a part of the installed format.
ElementPtr trimmed(const ElementPtr& full, const std::string& path, Schema& schema) {
  // A missing parent or child would end the parsing; the joint's own check names it.
  const bool of_joint = path == "model/joint/parent" || path == "model/joint/child";
  ElementPtr element = make_element(full->GetName(), of_joint ? "0" : full->GetRequired());
  for (const sdf::ParamPtr& attribute : full->GetAttributes()) {
    element->AddAttribute(attribute->GetKey(), "string", attribute->GetDefaultAsString(), false);
  }
  if (const sdf::ParamPtr value = full->GetValue()) {
    element->AddValue("string", value->GetDefaultAsString(), false);
    schema.types[path] = value->GetTypeName();
  }
  for (unsigned i = 0; i < full->GetElementDescriptionCount(); ++i) {
    const ElementPtr child = full->GetElementDescription(i);
    const std::string child_path = path + "/" + child->GetName();
    if (is_cut(child->GetName()) || !is_used(child_path)) continue;
    element->AddElementDescription(trimmed(child, child_path, schema));
  }
  return element;
}

/// Elements that are used and not in the installed format: our own, and those of later versions.
bool is_added(std::string_view path) {
  return path.find("/haptic:") != path.npos || path.find("/geometry/cone/") != path.npos;
}

/// The type of what is in it.
const char* type_of_added(std::string_view path) {
  if (path.ends_with("/pose")) return "pose";
  return path.find("/haptic:") == path.npos ? "double" : "string";
}

/// Adds the elements that have the rule's path.
void add_elements(const ElementPtr& element, std::string_view path, std::string_view rest,
                  Schema& schema) {
  const std::size_t slash = rest.find('/');
  const std::string name(rest.substr(0, slash));
  const std::string own_path = std::string(path) + "/" + name;
  ElementPtr child = element->HasElementDescription(name) ? element->GetElementDescription(name)
                                                          : make_element(name, "*");
  if (!element->HasElementDescription(name)) element->AddElementDescription(child);
  if (slash != rest.npos) return add_elements(child, own_path, rest.substr(slash + 1), schema);
  const std::string type = type_of_added(own_path);
  child->AddValue("string", type == "double" ? "1" : "", false);
  schema.types[own_path] = type;
}

Schema build() {
  const auto full = std::make_shared<sdf::SDF>();
  sdf::init(full);
  Schema schema;
  schema.root = make_element("sdf", "1");
  schema.root->AddAttribute("version", "string", "", false);
  for (const std::string top : {"model", "world"}) {
    const ElementPtr element = trimmed(full->Root()->GetElementDescription(top), top, schema);
    if (top == "world") element->AddElementDescription(schema.root->GetElementDescription("model"));
    for (const ElementRule& rule : element_rules()) {
      if (!is_added(rule.path) || !rule.path.starts_with(top + "/")) continue;
      add_elements(element, top, rule.path.substr(top.size() + 1), schema);
    }
    schema.root->AddElementDescription(element);
  }
  return schema;
}

const Schema& schema() {
  static const Schema kSchema = build();
  return kSchema;
}

// Values.

/// Why a text is not this many numbers within ±largest; empty if it is.
std::string find_number_error(const std::string& text, int count, double largest,
                              const std::string& what = "") {
  std::istringstream words(text);
  int found = 0;
  bool valid = true;
  for (std::string word; words >> word; ++found) {
    char* end = nullptr;
    const double number = std::strtod(word.c_str(), &end);
    valid = valid && *end == '\0' && std::abs(number) <= largest;
  }
  if (valid && found == count) return "";
  std::string error = "'" + text + "' must be " + std::to_string(count);
  error.append(count == 1 ? " number" : " numbers").append(what);
  if (largest == kLargest) error.append(", each within ±1e6");
  return error;
}

std::string find_pose_error(sdf::Element& pose, const std::string& text) {
  const auto format = pose.HasAttribute("rotation_format")
                          ? pose.Get<std::string>("rotation_format")
                          : std::string("euler_rpy");
  if (format != "euler_rpy" && format != "quat_xyzw") {
    return "rotation_format '" + format + "' must be euler_rpy or quat_xyzw";
  }
  if (text.empty()) return "";
  const int count = format == "quat_xyzw" ? 7 : 6;
  const char* what = count == 6 ? ": x y z (m) roll pitch yaw (rad)" : ": x y z (m) qx qy qz qw";
  std::string error = find_number_error(text, count, kLargest, what);
  if (!error.empty()) return error;
  std::istringstream numbers(text);
  double number = 0;
  double square = 0;
  for (int i = 0; numbers >> number; ++i) square += i < 3 ? 0 : number * number;
  if (count == 7 && !(square > 0)) return "'" + text + "' has a quaternion of length 0";
  return "";
}

std::string find_truth_error(const std::string& text) {
  for (const char* word : {"true", "false", "1", "0", "True", "False", "TRUE", "FALSE"}) {
    if (text == word) return "";
  }
  return "'" + text + "' must be true or false";
}

std::string find_value_error(sdf::Element& element, const std::string& path,
                             const std::string& type, const std::string& text) {
  constexpr double kFinite = std::numeric_limits<double>::max();
  if (type == "pose") return find_pose_error(element, text);
  if (text.empty()) return "";  // The default.
  if (type == "bool") return find_truth_error(text);
  if (type == "vector3") return find_number_error(text, 3, kLargest);
  if (type == "vector2d") return find_number_error(text, 2, kLargest);
  const bool limit = path.find("/limit/") != path.npos;
  if (type == "double") return find_number_error(text, 1, limit ? HUGE_VAL : kFinite);
  if (type == "int") return find_number_error(text, 1, kLargest);
  return "";
}

}  // namespace

ElementPtr make_schema() { return schema().root->Clone(); }

bool has_value(const std::string& path) { return schema().types.contains(path); }

void check_values(const ElementPtr& element, Diagnostics& diagnostics) {
  const std::string path = path_of(element);
  const auto type = schema().types.find(path);
  const sdf::ParamPtr value = element->GetValue();
  if (value && type != schema().types.end()) {
    const std::string error = find_value_error(*element, path, type->second, value->GetAsString());
    if (!error.empty()) {
      const ElementPtr parent = element->GetParent();
      const bool named = !parent || parent->HasAttribute("name");
      diagnostics.refuse(place_of(element), (named ? "" : tag(parent->GetName()) + " ") +
                                                tag(element->GetName()) + " " + error);
      value->Reset();
      for (const sdf::ParamPtr& attribute : element->GetAttributes()) attribute->Reset();
    }
  }
  for (ElementPtr child = element->GetFirstElement(); child; child = child->GetNextElement()) {
    check_values(child, diagnostics);
  }
}

}  // namespace hlm::ve
