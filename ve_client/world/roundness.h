// Which turns leave a body where it is?
#pragma once

#include "hlm/common/contact.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

struct BodyRoundness {
  Roundness kind = Roundness::kNone;
  Vector3 axis_B = Vector3::Zero();  ///< Unit, with Roundness::kAxis.
};

/// The roundness of the body's collisions together. A body whose joints have limits is never round:
/// their contacts do go round with it.
BodyRoundness roundness_of(const WorldDescription& world, int body);

}  // namespace hlm::ve
