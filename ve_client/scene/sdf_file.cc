#include "hlm/ve_client/scene/sdf_file.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>

#include "hlm/ve_client/scene/resources.h"
#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/urdf.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;
using tinyxml2::XMLElement;

/// What libsdformat converts to. Later versions are read as this one.
constexpr const char* kLatestVersion = "1.9";

/// Prints elements on the lines on which they stood.
class PrinterOnLines : public tinyxml2::XMLPrinter {
 public:
  PrinterOnLines() : XMLPrinter(nullptr, true) {}

  bool VisitEnter(const XMLElement& element, const tinyxml2::XMLAttribute* attributes) override {
    for (; line_ < element.GetLineNum(); ++line_) PushText("\n");
    return XMLPrinter::VisitEnter(element, attributes);
  }
  bool Visit(const tinyxml2::XMLText& text) override {
    const std::string_view value = text.Value();
    line_ += static_cast<int>(std::ranges::count(value, '\n'));
    return XMLPrinter::Visit(text);
  }
  bool Visit(const tinyxml2::XMLComment&) override { return true; }

 private:
  int line_ = 1;
};

/// Major and minor number of a version, for comparison; zeros if it is none.
std::pair<int, int> numbers_of(const std::string& version) {
  std::istringstream text(version);
  std::pair<int, int> numbers;
  char dot = 0;
  text >> numbers.first >> dot >> numbers.second;
  return numbers;
}

/// What libsdformat converts, and what can be read nearly as well.
bool is_known(const std::string& version) {
  const auto [major, minor] = numbers_of(version);
  return major == 1 && minor >= 2;
}

bool read_version(SdfFile& file, Diagnostics& diagnostics) {
  const char* version = file.root->Attribute("version");
  if (version == nullptr || !is_known(version)) {
    diagnostics.refuse(place_of(*file.root, file),
                       std::string("<sdf> version '") + (version == nullptr ? "" : version) +
                           "' must be 1.2 to " + kLatestVersion + ", or a later 1");
    return false;
  }
  file.version = version;
  if (numbers_of(version) > numbers_of(kLatestVersion)) {
    diagnostics.approximate(place_of(*file.root, file), "SDFormat " + file.version +
                                                            " is read as " + kLatestVersion +
                                                            ", the latest that is known");
    file.version = kLatestVersion;
    file.root->SetAttribute("version", kLatestVersion);
  }
  return true;
}

/// Elements whose names others refer to.
bool is_referred_to(std::string_view type) {
  constexpr std::string_view kTypes[] = {"model", "link", "joint", "frame", "collision"};
  return std::ranges::find(kTypes, type) != std::end(kTypes);
}

/// Refuses the names that libsdformat takes for paths: it makes models of them, or ends the
/// program. Those of what is not read, as lights and sensors, lose their colons.
void check_names(XMLElement& element, bool read, const SdfFile& file, Diagnostics& diagnostics) {
  const std::string_view type = element.Name();
  // What is in a plugin or belongs to another program is not looked at.
  if (type == "plugin" || type.find(':') != type.npos) return;
  read = read && type != "state";
  for (XMLElement* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    check_names(*child, read, file, diagnostics);
  }
  const char* given = element.Attribute("name");
  if (given == nullptr) return;
  std::string name = given;
  if (type == "link" && name == "world") {  // Those who refer to it mean the world.
    name = "world_link";
    element.SetAttribute("name", name.c_str());
    diagnostics.approximate(place_of(element, file),
                            "'world' is the world's own name: the link is named so here");
  }
  const bool in_path = name.find("::") != name.npos;
  if (!read || !is_referred_to(type)) {
    std::ranges::replace(name, ':', '_');
    if (in_path) element.SetAttribute("name", name.c_str());
  } else if (in_path || name.empty()) {
    diagnostics.refuse(place_of(element, file),
                       tag(type) + " name '" + name +
                           (in_path ? "' must not have '::' in it, which leads into a model within "
                                      "a model; write that as <model> within <model>"
                                    : "' must not be empty"));
  }
}

bool have_names(SdfFile& file, Diagnostics& diagnostics) {
  const int refused = diagnostics.count(Verdict::kRefused);
  check_names(*file.root, true, file, diagnostics);
  return diagnostics.count(Verdict::kRefused) == refused;
}

/// "XML_ERROR_MISMATCHED_ELEMENT" as a person says it.
std::string reason_of(const tinyxml2::XMLDocument& document) {
  std::string reason = document.ErrorName();
  constexpr std::string_view kPrefix = "XML_ERROR_";
  if (reason.starts_with(kPrefix)) reason.erase(0, kPrefix.size());
  for (char& c : reason) c = c == '_' ? ' ' : static_cast<char>(std::tolower(c));
  return reason;
}

bool read_root(SdfFile& file, Diagnostics& diagnostics) {
  const Place whole{file.name, 0, ""};
  if (file.document->Error()) {
    diagnostics.refuse({file.name, file.document->ErrorLineNum(), ""},
                       "is not XML: " + reason_of(*file.document));
    return false;
  }
  file.root = file.document->RootElement();
  if (file.root == nullptr) {
    diagnostics.refuse(whole, "is empty; it must hold <sdf> or <robot>");
    return false;
  }
  const std::string name = file.root->Name();
  if (name == "robot") {
    file.version = kLatestVersion;
    return rewrite_urdf(file, diagnostics) && have_names(file, diagnostics);
  }
  if (name == "sdf") return read_version(file, diagnostics) && have_names(file, diagnostics);
  diagnostics.refuse(
      place_of(*file.root, file),
      tag(name) + (name == "mujoco" ? " is a model of MuJoCo; the MuJoCo adapter takes those: "
                                      "haptic_local_model.mujoco, in Python"
                                    : " must be <sdf>, or <robot> of a URDF file"));
  return false;
}

std::shared_ptr<SdfFile> make_file(const std::string& name) {
  auto file = std::make_shared<SdfFile>();
  file->name = name;
  file->document = std::make_unique<tinyxml2::XMLDocument>(true, tinyxml2::COLLAPSE_WHITESPACE);
  return file;
}

std::string text_in(const XMLElement& parent, const char* child) {
  const XMLElement* element = parent.FirstChildElement(child);
  return element != nullptr && element->GetText() != nullptr ? element->GetText() : "";
}

/// What a model.config names: the file of the latest version that is known. Empty if it names none.
std::string named_in(const fs::path& config) {
  tinyxml2::XMLDocument document;
  document.LoadFile(config.c_str());
  const XMLElement* root = document.RootElement();
  const XMLElement* best = nullptr;
  const auto rank = [](const XMLElement& element) {
    const char* version = element.Attribute("version");
    const auto numbers = numbers_of(version != nullptr ? version : "");
    return numbers <= numbers_of(kLatestVersion) ? numbers : std::pair(-1, 0);
  };
  for (const XMLElement* each = root != nullptr ? root->FirstChildElement("sdf") : nullptr;
       each != nullptr; each = each->NextSiblingElement("sdf")) {
    if (best == nullptr || rank(*each) > rank(*best)) best = each;
  }
  return best != nullptr && best->GetText() != nullptr ? best->GetText() : "";
}

/// The SDF or URDF file that a file or a model's folder stands for; empty if it holds none.
fs::path model_file(const fs::path& found) {
  std::error_code error;
  if (!fs::is_directory(found, error)) return found;
  const std::string named = named_in(found / "model.config");
  const fs::path file = found / (named.empty() ? "model.sdf" : named);
  return fs::is_regular_file(file, error) ? file : fs::path();
}

/// What a file may hold instead of a model, as Gazebo's sun does. Whether there is any.
bool ignore_lights(const SdfFile& file, Diagnostics& diagnostics) {
  const XMLElement* light = file.root->FirstChildElement("light");
  if (light != nullptr) diagnostics.ignore(place_of(*light, file), "<light>: no part in contact");
  return light != nullptr;
}

/// Nearly every world of Gazebo includes its sun, which comes with Gazebo.
bool is_sun(const std::string& uri) {
  const std::string name = uri.substr(uri.rfind('/') + 1);
  return name == "sun" || name == "Sun";
}

std::string chain_of(const SdfFile& file, const fs::path& last) {
  const auto shown = [](const fs::path& path) {
    return (path.parent_path().filename() / path.filename()).string();
  };
  std::string chain;
  for (const fs::path& path : file.includers) chain += shown(path) + ", ";
  return chain + shown(file.path) + ", " + shown(last);
}

}  // namespace

std::shared_ptr<SdfFile> read_file(const fs::path& path, Diagnostics& diagnostics) {
  const std::shared_ptr<SdfFile> file = make_file(path.string());
  file->path = path;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    diagnostics.refuse({file->name, 0, ""}, "does not exist or is no file");
    return nullptr;
  }
  file->document->LoadFile(path.c_str());
  return read_root(*file, diagnostics) ? file : nullptr;
}

std::shared_ptr<SdfFile> parse_file(const std::string& text, const std::string& name,
                                    Diagnostics& diagnostics) {
  const std::shared_ptr<SdfFile> file = make_file(name);
  file->document->Parse(text.c_str(), text.size());
  return read_root(*file, diagnostics) ? file : nullptr;
}

XMLElement* find_root_model(const SdfFile& file, Diagnostics& diagnostics) {
  if (std::string_view(file.root->Name()) == "model") return file.root;  // It was a <robot>.
  XMLElement* model = file.root->FirstChildElement("model");
  if (model == nullptr) {
    if (!ignore_lights(file, diagnostics)) {
      diagnostics.refuse(place_of(*file.root, file), "<sdf> holds no <world> and no <model>");
    }
  } else if (const XMLElement* second = model->NextSiblingElement("model")) {
    diagnostics.refuse(place_of(*second, file), "a second <model>; without <world> there is one");
    return nullptr;
  }
  return model;
}

std::shared_ptr<SdfFile> read_included(const XMLElement& include, const SdfFile& file,
                                       Diagnostics& diagnostics) {
  const Place place = place_of(include, file);
  const std::string uri = text_in(include, "uri");
  const auto found = find_resource(uri, file.path);
  const fs::path path = found ? model_file(*found) : fs::path();
  if (!found && is_sun(uri)) {
    diagnostics.ignore(place, "<include> of '" + uri +
                                  "' is not found; Gazebo's sun is a light, with no part in "
                                  "contact");
    return nullptr;
  }
  if (path.empty()) {
    const std::string why =
        found ? "is " + found->string() +
                    ", which holds neither model.sdf nor what a model.config names"
              : "is not found; " + resource_remedy(uri, file.path);
    diagnostics.refuse(place, "<include> of '" + uri + "' " + why);
    return nullptr;
  }
  std::error_code error;
  const auto is_same = [&](const fs::path& other) { return fs::equivalent(path, other, error); };
  if (std::ranges::any_of(file.includers, is_same) || (!file.path.empty() && is_same(file.path))) {
    diagnostics.refuse(place,
                       "<include> of '" + uri +
                           "' leads back to a file that it is part of: " + chain_of(file, path));
    return nullptr;
  }
  const fs::path shown = file.path.is_absolute() ? path : fs::proximate(path, error);
  const std::shared_ptr<SdfFile> included = read_file(shown, diagnostics);
  if (!included) return nullptr;
  included->includers = file.includers;
  if (!file.path.empty()) included->includers.push_back(file.path);
  XMLElement* model = find_root_model(*included, diagnostics);
  if (model == nullptr) return nullptr;
  const std::string name = text_in(include, "name");
  if (!name.empty()) model->SetAttribute("name", name.c_str());
  return included;
}

std::string text_of(const XMLElement& element, const SdfFile& file) {
  PrinterOnLines printer;
  printer.OpenElement("sdf", true);
  printer.PushAttribute("version", file.version.c_str());
  const bool is_world = std::string_view(element.Name()) == "world";
  if (!is_world) printer.OpenElement("world", true);
  element.Accept(&printer);
  if (!is_world) printer.CloseElement(true);
  printer.CloseElement(true);
  return printer.CStr();
}

}  // namespace hlm::ve
