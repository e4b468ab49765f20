#include "hlm/ve_client/scene/sdf_document.h"

#include <string_view>

namespace hlm::ve {

Place place_of(const tinyxml2::XMLElement& element, const SdfFile& file) {
  Place place{file.name, element.GetLineNum(), ""};
  for (const tinyxml2::XMLNode* at = &element; at != nullptr; at = at->Parent()) {
    const tinyxml2::XMLElement* named = at->ToElement();
    const char* name = named != nullptr ? named->Attribute("name") : nullptr;
    if (name == nullptr || std::string_view(named->Name()) == "world") continue;
    const std::string own = std::string(named->Name()) + " '" + name + "'";
    place.element = place.element.empty() ? own : own + " " + place.element;
  }
  return place;
}

}  // namespace hlm::ve
