// Collision shapes as the engine's geometries.
#pragma once

#include <ode/ode.h>

#include "hlm/common/spatial.h"
#include "hlm/geometry/shape.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// A geometry with the shape, at X_WG; with a body, fixed in it at X_BG. Of shapes that the engine
/// does not have it is a box around them: only bounding boxes are asked of the engine.
dGeomID create_geometry(dSpaceID space, const Shape& shape, const Pose& X_WG, dBodyID body,
                        const Pose& X_BG);

}  // namespace hlm::ve
