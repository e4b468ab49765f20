// Which word a person may have meant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace hlm::settings {

/// "; did you mean 'NEAREST'?" for the known word that takes the fewest letters to change, insert
/// or leave out; empty if none is near.
std::string suggestion(std::string_view word, const std::vector<std::string>& known);

}  // namespace hlm::settings
