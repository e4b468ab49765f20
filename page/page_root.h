// Where the page's files are.
#pragma once

#include <filesystem>

namespace hlm::ve {

/// At a fixed place next to the program, built or installed.
std::filesystem::path page_beside_program();

}  // namespace hlm::ve
