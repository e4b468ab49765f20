// Reads a world from an SDFormat file.
#pragma once

#include <filesystem>
#include <string>

#include "ve_client/world/world_description.h"

namespace hlm::ve {

/// The only world in `file`. Throws std::runtime_error with one line that names the file, the
/// element, its value and what is allowed, where the file is missing or broken or holds something
/// that this program does not support.
WorldDescription load_world(const std::filesystem::path& file);

/// The same from the text of an SDF file; `name` stands for the file in messages.
WorldDescription parse_world(const std::string& text, const std::string& name);

/// An element's text on one line: its words, with single spaces.
std::string single_spaced(const std::string& text);

}  // namespace hlm::ve
