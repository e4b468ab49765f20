// Conversion of SDFormat's joints to ours.
#pragma once

#include <sdf/Joint.hh>

#include "hlm/scene/diagnostics.h"
#include "hlm/scene/world_description.h"

namespace hlm::ve {

/// Type, axis, limits, spring and damping of a joint; its name, bodies and pose are left as they
/// are. What cannot be used is refused and left at its default: the type at fixed.
JointDescription to_joint(const sdf::Joint& joint, Diagnostics& diagnostics);

}  // namespace hlm::ve
