// Shapes as the wire has them, for the geometry.
#pragma once

#include "hlm/geometry/shape_parts.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::server {

/// shape: as SceneRecordReader has checked it.
geometry::AnyShape any_shape(const protocol::SceneShape& shape);

}  // namespace hlm::server
