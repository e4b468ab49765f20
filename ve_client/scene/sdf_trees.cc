#include "hlm/ve_client/scene/sdf_trees.h"

#include <algorithm>
#include <set>

#include <sdf/Exception.hh>
#include <sdf/SDFImpl.hh>
#include <sdf/parser.hh>

#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/sdf_places.h"
#include "hlm/ve_client/scene/sdf_schema.h"

namespace hlm::ve {
namespace {

using sdf::ElementPtr;
using tinyxml2::XMLElement;

/// Files that include others several times, level by level, could go on for ever.
constexpr int kMostModels = 20000;

std::string word(const XMLElement& element, const char* attribute) {
  const char* value = element.Attribute(attribute);
  return value != nullptr ? value : "";
}

bool is_model(const XMLElement& element) {
  const std::string_view name = element.Name();
  return name == "model" || name == "include";
}

/// Takes the models out of an element, in their order.
std::vector<XMLElement*> cut_models(XMLElement& parent, tinyxml2::XMLDocument& document) {
  std::vector<XMLElement*> models;
  for (XMLElement* child = parent.FirstChildElement(); child != nullptr;) {
    XMLElement* next = child->NextSiblingElement();
    if (is_model(*child)) {
      // Only an insertion takes an element from its place without destroying it.
      document.InsertEndChild(child);
      models.push_back(child);
    }
    child = next;
  }
  return models;
}

/// Whether the pose of a model or <include> is given in another frame than its parent's.
bool is_relative(const XMLElement& element) {
  const XMLElement* pose = element.FirstChildElement("pose");
  return pose != nullptr && !(word(*pose, "relative_to") + word(*pose, "frame")).empty();
}

std::string text_in(const XMLElement* element) {
  return element != nullptr && element->GetText() != nullptr ? element->GetText() : "";
}

/// Sets a child of an included model to what the <include> says of it.
void carry_over(const XMLElement& given, const SdfFile& file, const ElementPtr& model,
                Diagnostics& diagnostics) {
  const ElementPtr own = model->GetElement(given.Name());
  own->SetLineNumber(given.GetLineNum());
  own->SetFilePath(file.name);
  for (const sdf::ParamPtr& attribute : own->GetAttributes()) {
    attribute->Reset();
    const std::string value = word(given, attribute->GetKey().c_str());
    if (!value.empty()) attribute->SetFromString(value);
  }
  const std::string frame = word(given, "frame");  // Before SDFormat 1.7.
  const sdf::ParamPtr relative_to = own->GetAttribute("relative_to");
  if (relative_to && !frame.empty()) relative_to->SetFromString(frame);
  own->GetValue()->SetFromString(text_in(&given));
  check_values(own, diagnostics);
}

void set_attribute(const ElementPtr& element, const char* name, const std::string& from,
                   const std::string& to) {
  const sdf::ParamPtr attribute = element->GetAttribute(name);
  if (attribute && attribute->GetAsString() == from) attribute->SetFromString(to);
}

/// Lets all below `element` that refers to its model refer to that frame.
void set_model_frame(const ElementPtr& element, const std::string& frame) {
  constexpr const char* kModel = "__model__";
  for (const char* name : {"relative_to", "attached_to", "expressed_in"}) {
    set_attribute(element, name, kModel, frame);
  }
  const sdf::ParamPtr value = element->GetValue();
  const bool is_end = element->GetName() == "parent" || element->GetName() == "child";
  if (is_end && value && value->GetAsString() == kModel) value->SetFromString(frame);
  for (ElementPtr child = element->GetFirstElement(); child; child = child->GetNextElement()) {
    if (child->GetName() != "model" || element->GetName() != "model") set_model_frame(child, frame);
  }
}

/// The link to which a model's frame is attached; empty if it has none.
std::string canonical_link(const ElementPtr& model) {
  std::string name = model->Get<std::string>("canonical_link");
  if (!name.empty()) return name;
  if (const ElementPtr link = model->FindElement("link")) return link->Get<std::string>("name");
  for (ElementPtr inner = model->FindElement("model"); inner;
       inner = inner->GetNextElement("model")) {
    name = canonical_link(inner);
    if (!name.empty()) return inner->Get<std::string>("name") + "::" + name;
  }
  return "";
}

/// Puts the parts of an included model into another, as <include merge="true"> says. As in
/// libsdformat a frame stands for the included model's own.
void merge(const ElementPtr& included, const ElementPtr& model) {
  const std::string name = "_merged__" + included->Get<std::string>("name") + "__model__";
  const ElementPtr frame = model->AddElement("frame");
  frame->GetAttribute("name")->SetFromString(name);
  frame->GetAttribute("attached_to")->SetFromString(canonical_link(included));
  const ElementPtr pose = included->GetElement("pose")->Clone();
  set_attribute(pose, "relative_to", "", "__model__");
  pose->SetParent(frame);
  frame->InsertElement(pose);
  for (ElementPtr child = included->GetFirstElement(); child;) {
    const ElementPtr next = child->GetNextElement();
    const std::string type = child->GetName();
    const bool placed = type == "link" || type == "model";
    if (placed || type == "joint" || type == "frame" || type.find(':') != type.npos) {
      if (placed) set_attribute(child->GetElement("pose"), "relative_to", "", name);
      if (type == "frame") set_attribute(child, "attached_to", "", name);
      set_model_frame(child, name);
      if (child->FilePath().empty()) child->SetFilePath(included->FilePath());
      included->RemoveChild(child);
      child->SetParent(model);
      model->InsertElement(child);
    }
    child = next;
  }
}

/// Whether an element may stand once in its parent.
bool is_single(const ElementPtr& parent, const std::string& name) {
  const std::string& required = parent->GetElementDescription(name)->GetRequired();
  return required == "0" || required == "1";
}

/// Of what may stand once, and of the shapes of a geometry, the first counts.
void drop_repeated(const ElementPtr& element, Diagnostics& diagnostics) {
  std::set<std::string> names;
  const bool one_of_all = element->GetName() == "geometry";
  for (ElementPtr child = element->GetFirstElement(); child;) {
    const ElementPtr next = child->GetNextElement();
    const std::string name = child->GetName();
    const bool repeated = is_single(element, name) && names.contains(name);
    if (repeated) {
      diagnostics.approximate(place_of(child), "a second " + tag(name) + " in " +
                                                   tag(element->GetName()) + " is not read");
    } else if (one_of_all && !names.empty()) {
      diagnostics.approximate(place_of(child), tag(name) +
                                                   " is not read: " + tag(element->GetName()) +
                                                   " has a shape, " + tag(*names.begin()));
    }
    if (repeated || (one_of_all && !names.empty())) {
      element->RemoveChild(child);
    } else {
      names.insert(name);
    }
    child = next;
  }
}

/// The parser keeps what it does not know, and libsdformat would look at it. Elements with a colon
/// it keeps without a word: ours must be known.
void drop_unused(const ElementPtr& element, Diagnostics& diagnostics) {
  for (ElementPtr child = element->GetFirstElement(); child;) {
    const ElementPtr next = child->GetNextElement();
    if (element->HasElementDescription(child->GetName())) {
      drop_unused(child, diagnostics);
      child = next;
      continue;
    }
    const std::string name = child->GetName();
    if (name.starts_with("haptic:")) {
      diagnostics.refuse(place_of(child),
                         tag(name) + " is not known here; " + allowed_beside(path_of(child)));
    }
    element->RemoveChild(child);
    child = next;
  }
  drop_repeated(element, diagnostics);
}

}  // namespace

namespace {

/// The same, and attributes that are not in the schema are errors too.
sdf::ParserConfig attribute_config() {
  sdf::ParserConfig config = parser_config();
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetDeprecatedElementsPolicy(sdf::EnforcementPolicy::LOG);
  return config;
}

}  // namespace

sdf::ParserConfig parser_config() {
  sdf::ParserConfig config;
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  return config;
}

SdfTrees::SdfTrees(SdfFile& file, CapturedMessages& messages, Diagnostics& diagnostics)
    : file_(file), messages_(messages), diagnostics_(diagnostics) {
  world_ = file.root->FirstChildElement("world");
  if (world_ == nullptr) {
    if (XMLElement* model = find_root_model(file, diagnostics)) models_.push_back(model);
    return;
  }
  if (const XMLElement* second = world_->NextSiblingElement("world")) {
    diagnostics.refuse(place_of(*second, file), "a second <world>; exactly one is allowed");
  }
  models_ = cut_models(*world_, *file.document);
  connected_ = world_->FirstChildElement("frame") != nullptr;
  for (const XMLElement* model : models_) connected_ = connected_ || is_relative(*model);
}

ElementPtr SdfTrees::world() {
  if (world_ != nullptr) return parse(*world_, file_, "");
  tinyxml2::XMLDocument document;
  document.Parse("<world name='model'/>");
  SdfFile empty;
  empty.name = file_.name;
  empty.version = SDF_PROTOCOL_VERSION;
  return parse(*document.RootElement(), empty, "");
}

ElementPtr SdfTrees::model(int index) {
  return read_either(*models_[static_cast<std::size_t>(index)], file_, "");
}

ElementPtr SdfTrees::read_either(XMLElement& element, SdfFile& file, const std::string& scope) {
  if (++read_ > kMostModels) {
    if (read_ == kMostModels + 1) {
      diagnostics_.refuse(
          place_of(element, file),
          "too many models; at most " + std::to_string(kMostModels) + " are allowed");
    }
    return nullptr;
  }
  const bool included = std::string_view(element.Name()) == "include";
  return included ? read_include(element, file, scope) : read_model(element, file, scope);
}

ElementPtr SdfTrees::read_include(const XMLElement& include, const SdfFile& file,
                                  const std::string& scope) {
  const std::shared_ptr<SdfFile> included = read_included(include, file, diagnostics_);
  if (!included) return nullptr;
  if (include.BoolAttribute("merge") &&
      (scope.empty() || include.FirstChildElement("placement_frame") != nullptr)) {
    diagnostics_.refuse(place_of(include, file),
                        "merge='true' is allowed for an <include> in a <model>, without "
                        "<placement_frame>");
    return nullptr;
  }
  XMLElement& model = *find_root_model(*included, diagnostics_);
  ElementPtr element = read_model(model, *included, scope);
  if (!element) return nullptr;
  for (const char* name : {"pose", "static"}) {
    const XMLElement* given = include.FirstChildElement(name);
    if (given != nullptr) carry_over(*given, file, element, diagnostics_);
  }
  const std::string frame = text_in(include.FirstChildElement("placement_frame"));
  if (!frame.empty()) element->GetAttribute("placement_frame")->SetFromString(frame);
  return element;
}

ElementPtr SdfTrees::read_model(XMLElement& model, SdfFile& file, const std::string& scope) {
  const std::vector<XMLElement*> inner = cut_models(model, *file.document);
  ElementPtr element = parse(model, file, scope);
  if (element) element = element->FindElement("world");
  if (element) element = element->FindElement("model");
  if (!element) return nullptr;
  element->SetFilePath(file.name);
  const std::string own = "model '" + word(model, "name") + "'";
  for (XMLElement* each : inner) {
    const ElementPtr nested = read_either(*each, file, scope.empty() ? own : scope + " " + own);
    if (!nested) continue;
    if (each->BoolAttribute("merge")) {
      if (nested->Get<bool>("static", false).first) {
        diagnostics_.approximate(place_of(*each, file),
                                 "<static> of a model that is merged is not read: that of the "
                                 "model around it counts");
      }
      merge(nested, element);
      continue;
    }
    nested->SetParent(element);
    element->InsertElement(nested);
  }
  return element;
}

ElementPtr SdfTrees::parse(const XMLElement& element, const SdfFile& file,
                           const std::string& scope) {
  auto sdf = std::make_shared<sdf::SDF>();
  sdf->Root(make_schema());
  messages_.clear();
  sdf::Errors errors;
  bool done = false;
  try {
    done = sdf::readString(text_of(element, file), attribute_config(), sdf, errors);
  } catch (const sdf::Exception& error) {  // An assertion of its own; it is no std::exception.
    diagnostics_.refuse(place_of(element, file),
                        "libsdformat cannot read it: " + error.GetErrorStr());
  }
  const int refused = diagnostics_.count(Verdict::kRefused);
  report(errors, file, scope);
  if (!done && diagnostics_.count(Verdict::kRefused) == refused) {
    diagnostics_.refuse(place_of(element, file), messages_.first_error());
  }
  if (!done) return nullptr;
  const ElementPtr root = sdf->Root();
  root->SetFilePath(file.name);
  drop_unused(root, diagnostics_);
  check_values(root, diagnostics_);
  return root;
}

void SdfTrees::report_attribute(const sdf::Error& error, const SdfFile& file,
                                const std::string& scope) {
  // The path ends with it: "…/box[@size="1 1 1"]".
  const std::string path = error.XmlPath().value_or("");
  const std::size_t begin = path.rfind("[@");
  const std::size_t equals = path.find("=\"", begin);
  if (begin == path.npos || equals == path.npos) return;
  const std::string name = path.substr(begin + 2, equals - begin - 2);
  const std::string value = path.substr(equals + 2, path.size() - equals - 4);
  const ParserPath at = parse_parser_path(path.substr(0, begin) + "/" + name);
  const std::string owner_path = at.path.substr(0, at.path.rfind('/'));
  const std::string owner = owner_path.substr(owner_path.rfind('/') + 1);
  Place place{file.name, error.LineNumber().value_or(0), scope};
  if (!scope.empty() && !at.above.empty()) place.element += " ";
  place.element += describe(at.above);
  std::string remedy = tag(owner) + " has no such attribute";
  if (has_value(at.path)) {
    remedy = "write " + tag(name) + value + tag("/" + name) + " in " + tag(owner);
  } else if (name == "value" && has_value(owner_path)) {
    remedy = "write " + tag(owner) + value + tag("/" + owner);
  }
  diagnostics_.approximate(
      place, tag(owner) + " attribute " + name + " '" + value + "' is not read; " + remedy);
}

void SdfTrees::report(const sdf::Errors& errors, const SdfFile& file, const std::string& scope) {
  for (const sdf::Error& error : errors) {
    if (error.Code() == sdf::ErrorCode::ATTRIBUTE_INCORRECT_TYPE) {
      report_attribute(error, file, scope);
      continue;
    }
    const ParserPath at = parse_parser_path(error.XmlPath().value_or(""));
    Place place{file.name, error.LineNumber().value_or(0), scope};
    if (!scope.empty() && !at.above.empty()) place.element += " ";
    place.element += describe(at.above);
    if (error.Code() != sdf::ErrorCode::ELEMENT_INCORRECT_TYPE || at.path.empty()) {
      if (error.LineNumber()) diagnostics_.refuse(place, error.Message());
      continue;
    }
    const std::string name = tag(at.last);
    const ElementRule* rule = find_rule(at.path);
    if (rule == nullptr || !rule->verdict) {
      diagnostics_.approximate(
          place, name + " is not known here, and not read; " + allowed_beside(at.path));
    } else if (*rule->verdict == Verdict::kRefused) {
      diagnostics_.refuse(place, name + " is not supported; " + std::string(rule->note));
    } else if (*rule->verdict == Verdict::kApproximated) {
      diagnostics_.approximate(place, name + ": " + std::string(rule->note));
    } else {
      diagnostics_.ignore(place, name + ": " + std::string(rule->note));
    }
  }
}

}  // namespace hlm::ve
