// SDF and URDF files as XML, before they are understood: their root, their version, what they
// include.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <tinyxml2.h>

#include "hlm/ve_client/scene/sdf_document.h"

namespace hlm::ve {

/// Reads a file, and `parse_file` a text that stands for the file `name`. Null, with the reason
/// refused, if it is not XML, or neither SDF nor URDF.
std::shared_ptr<SdfFile> read_file(const std::filesystem::path& path, Diagnostics& diagnostics);
std::shared_ptr<SdfFile> parse_file(const std::string& text, const std::string& name,
                                    Diagnostics& diagnostics);

/// The file that an <include> of `file` names, its model renamed as that says. Null, with the
/// reason refused, if there is no such file, it holds no model, or it includes itself. Null without
/// a refusal for a light, which has no part in contact.
std::shared_ptr<SdfFile> read_included(const tinyxml2::XMLElement& include, const SdfFile& file,
                                       Diagnostics& diagnostics);

/// The only model of a file whose root holds no world: <model>, or the root of a URDF file. Null,
/// with the reason refused, if there is none or several; a file with a light alone is no error.
tinyxml2::XMLElement* find_root_model(const SdfFile& file, Diagnostics& diagnostics);

/// The text of one <world> or <model> as a file of its own, a model in a world: poses may be
/// relative to what is there. Each element is on the line on which it stands in the file, so that
/// what the parser says of lines stays true.
std::string text_of(const tinyxml2::XMLElement& element, const SdfFile& file);

}  // namespace hlm::ve
