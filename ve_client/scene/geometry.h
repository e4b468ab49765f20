// The library of geometry, whose names are the virtual environment's too.
#pragma once

namespace hlm::geometry {}

namespace hlm::ve {

using namespace geometry;

}  // namespace hlm::ve
