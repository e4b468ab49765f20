// The methods that are compared, by name.
#pragma once

#include <string_view>

#include "hlm/common/methods.h"

namespace hlm::experiments {

/// Throws std::runtime_error naming the methods there are.
const Method& method(std::string_view name);

}  // namespace hlm::experiments
