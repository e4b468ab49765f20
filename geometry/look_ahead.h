// Which normals of a pair of shapes become the best while the tool goes its way?
#pragma once

#include "hlm/common/static_vector.h"
#include "hlm/geometry/core_pair.h"
#include "hlm/geometry/separation.h"

namespace hlm::geometry {

inline constexpr std::size_t kMostLooks = 6;

/// The shapes after a part of the tool's way.
struct Look {
  double share;               ///< Share of the way, 0 to 1.
  CoreSeparation separation;  ///< There.
};
using Looks = StaticVector<Look, kMostLooks + 1>;

/// The cores with the tool moved by travel_B (m).
inline CorePair moved(CorePair pair, const Vector3& travel_B) {
  pair.p_BT += travel_B;
  return pair;
}

/// Looks along the way travel_B (m), in its order, the first one `now`. Each of the others is where
/// those before tell the least gap, until that is 10 mm between the shapes: so far the tool may
/// leave its way.
Looks looks_ahead(const CorePair& pair, const CoreSeparation& now, const Vector3& travel_B);

}  // namespace hlm::geometry
