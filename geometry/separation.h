// The signed distance of two convex shapes, with its normal: exact, or refused.
#pragma once

#include <optional>

#include "hlm/geometry/core_separation.h"

namespace hlm::geometry {

/// None if the cores are farther apart than `beyond` (m, >= 0): then `apart_B` is a unit normal
/// with such a gap. The caller checks is_confirmed().
std::optional<CoreSeparation> find_separation(const CorePair& pair, double beyond,
                                              Vector3& apart_B);
inline std::optional<CoreSeparation> find_separation(const CorePair& pair, double beyond) {
  Vector3 apart_B;
  return find_separation(pair, beyond, apart_B);
}

Witness find_witness(const CorePair& pair, const CoreSeparation& separation);

}  // namespace hlm::geometry
