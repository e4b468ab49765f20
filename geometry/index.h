// Indices that may be negative for "none" elsewhere, where they stand for an element.
#pragma once

#include <cstddef>

namespace hlm::geometry {

/// `index` >= 0.
constexpr std::size_t at(int index) noexcept { return static_cast<std::size_t>(index); }

}  // namespace hlm::geometry
