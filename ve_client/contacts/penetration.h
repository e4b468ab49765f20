// The signed distance of cores that touch or overlap: which normal has the largest gap?
#pragma once

#include "ve_client/contacts/separation.h"

namespace hlm::ve {

/// `nearest` is the answer of closest_points(), whose relation is kTouching. Polytopes: exact, over
/// all normals of faces and cross products of edges. Curved cores: those and libccd's expanding
/// polytope.
CoreSeparation find_penetration(const CorePair& pair, const ClosestPoints& nearest);

}  // namespace hlm::ve
