// Reads a world from an SDFormat or URDF file.
#pragma once

#include <filesystem>
#include <string>

#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// The only world in `file`; a file with a model alone is a world with that model. All that is
/// refused, approximated or ignored goes to `diagnostics`. Where something is refused, the world is
/// what is left: to be examined, not to be used. docs/worlds.md has what files may hold.
WorldDescription load_world(const std::filesystem::path& file, Diagnostics& diagnostics);

/// The same, but throws RefusedWorld where something is refused.
WorldDescription load_world(const std::filesystem::path& file);

/// The same from the text of a file; `name` stands for it in messages. What it includes is searched
/// for in the working folder.
WorldDescription parse_world(const std::string& text, const std::string& name,
                             Diagnostics& diagnostics);
WorldDescription parse_world(const std::string& text, const std::string& name);

/// An element's text on one line: its words, with single spaces.
std::string single_spaced(const std::string& text);

}  // namespace hlm::ve
