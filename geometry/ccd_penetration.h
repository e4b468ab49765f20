// Penetration by libccd.
#pragma once

#include <optional>

#include "hlm/geometry/core_separation.h"

namespace hlm::geometry {

/// Overlap of the cores by libccd: `gap` of its normal, and as `upper` what the depth of its
/// polytope, which lies inside the Minkowski difference, proves. None if it finds no overlap.
std::optional<CoreSeparation> ccd_penetration(const CorePair& pair);

}  // namespace hlm::geometry
