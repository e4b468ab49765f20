#include "ve_client/world/sdf_places.h"

#include <vector>

namespace hlm::ve {
namespace {

bool begins_path(const std::string& name) { return name == "world" || name == "model"; }

std::string named(const std::string& type, const std::string& name) {
  return type + " '" + name + "'";
}

void append(std::string& line, const std::string& word) {
  line.append(line.empty() ? "" : " ").append(word);
}

}  // namespace

std::string describe(sdf::ElementPtr element) {
  std::vector<std::string> names;
  for (; element; element = element->GetParent()) {
    if (!element->HasAttribute("name") || element->GetName() == "world") continue;
    names.push_back(named(element->GetName(), element->Get<std::string>("name")));
  }
  std::string text;
  for (auto name = names.rbegin(); name != names.rend(); ++name) append(text, *name);
  return text;
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
  std::string pending;  // What describes the last element.
  std::size_t at = 0;
  while (at < text.size()) {
    ++at;  // The slash.
    const std::size_t end = text.find_first_of("/[", at);
    result.last = text.substr(at, end - at);
    if (begins_path(result.last)) result.path.clear();
    if (result.last != "sdf") {
      result.path.append(result.path.empty() ? "" : "/").append(result.last);
    }
    if (!pending.empty()) append(result.element, pending);
    pending.clear();
    if (end == text.npos) break;
    at = end;
    if (text.compare(at, kName.size(), kName) == 0) {
      const std::size_t name = at + kName.size();
      const std::size_t name_end = text.find("\"]", name);
      if (name_end == text.npos) break;
      if (result.last != "world") pending = named(result.last, text.substr(name, name_end - name));
      at = name_end + 2;
    }
    at = text.find('/', at);
  }
  return result;
}

}  // namespace hlm::ve
