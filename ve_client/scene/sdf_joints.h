// Conversion of SDFormat's joints to ours.
#pragma once

#include <sdf/Joint.hh>

#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// A joint as a file has it. Its limits, and the spring's rest, count from where it starts.
struct FileJoint {
  JointDescription joint;
  double start = 0;  ///< Position in which it starts, from that of the file's poses, rad or m.
  Place limits;      ///< Place of what makes it start there.
};

/// Type, axis, limits, spring and damping of a joint; its name, bodies and pose are left as they
/// are. What cannot be used is refused and left at its default: the type at fixed.
FileJoint to_joint(const sdf::Joint& joint, Diagnostics& diagnostics);

/// Moves the child of a joint of the world, and all that is joined to it, by `position`. Whether it
/// can: not if that leads back to the parent or to something fixed.
bool move_child(WorldDescription& world, std::size_t joint, double position);

}  // namespace hlm::ve
