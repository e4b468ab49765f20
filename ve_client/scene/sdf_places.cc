#include "hlm/ve_client/scene/sdf_places.h"

#include <algorithm>
#include <optional>
#include <string_view>

namespace hlm::ve {
namespace {

bool begins_path(const std::string& name) { return name == "world" || name == "model"; }

bool is_named(const sdf::Element& element) {
  return element.GetName() != "world" && element.GetAttributeSet("name");
}

}  // namespace

std::string describe(const std::vector<NamedElement>& elements) {
  std::string text;
  for (const NamedElement& element : elements) {
    if (!text.empty()) text += " ";
    text += element.type + " '" + element.name + "'";
  }
  return text;
}

std::string describe(sdf::ElementPtr element) {
  std::vector<NamedElement> elements;
  for (; element; element = element->GetParent()) {
    if (!is_named(*element)) continue;
    elements.insert(elements.begin(), {element->GetName(), element->Get<std::string>("name")});
  }
  return describe(elements);
}

Place place_of(const sdf::ElementPtr& element) {
  Place place{"", 0, describe(element)};
  for (sdf::ElementPtr at = element; at; at = at->GetParent()) {
    if (place.line == 0) place.line = at->LineNumber().value_or(0);
    if (place.file.empty()) place.file = at->FilePath();
    if (place.line > 0 && !place.file.empty()) break;
  }
  return place;
}

std::string path_of(const sdf::ElementPtr& element) {
  std::string path = element->GetName();
  for (sdf::ElementPtr at = element; at && !begins_path(at->GetName());) {
    at = at->GetParent();
    if (at) path = at->GetName() + "/" + path;
  }
  return path;
}

ParserPath parse_parser_path(const std::string& text) {
  constexpr std::string_view kName = "[@name=\"";
  ParserPath result;
  std::optional<NamedElement> last;
  for (std::size_t at = 0; at < text.size();) {
    ++at;  // The slash.
    const std::size_t end = std::min(text.find_first_of("/[", at), text.size());
    result.last = text.substr(at, end - at);
    if (begins_path(result.last)) result.path.clear();
    if (result.last != "sdf") {
      result.path.append(result.path.empty() ? "" : "/").append(result.last);
    }
    if (last && last->type != "world") result.above.push_back(*last);
    last.reset();
    at = end;
    if (text.compare(at, kName.size(), kName) == 0) {
      const std::size_t name = at + kName.size();
      const std::size_t name_end = std::min(text.find("\"]", name), text.size());
      last = {result.last, text.substr(name, name_end - name)};
      at = name_end;
    }
    at = std::min(text.find('/', at), text.size());
  }
  return result;
}

}  // namespace hlm::ve
