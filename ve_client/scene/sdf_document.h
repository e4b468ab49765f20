// An SDF or URDF file as XML, before it is understood.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <tinyxml2.h>

#include "hlm/ve_client/scene/diagnostics.h"

namespace hlm::ve {

/// A file that was read.
struct SdfFile {
  std::string name;            ///< Name for messages.
  std::filesystem::path path;  ///< Empty: it was given as text.
  std::unique_ptr<tinyxml2::XMLDocument> document;
  tinyxml2::XMLElement* root = nullptr;  ///< <sdf>, or the <model> of a URDF file.
  std::string version;                   ///< SDFormat version, as the parser is to convert it.
  std::vector<std::filesystem::path> includers;  ///< The files that led here, the first one first.
};

/// Where an element is, for messages.
Place place_of(const tinyxml2::XMLElement& element, const SdfFile& file);

}  // namespace hlm::ve
