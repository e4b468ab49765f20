// How many tools a world has at most.
#pragma once

#include <cstddef>

namespace hlm::ve {

/// That can be held in one world.
inline constexpr std::size_t kMostTools = 2;

}  // namespace hlm::ve
