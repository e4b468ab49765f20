// The limits of joints, as contacts: what a body that is turned or pushed against its stop meets.
#pragma once

#include <vector>

#include "hlm/geometry/feature.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// Adds the limits of a joint that are within epsilon (m, >= 0), as contacts of the joint's child
/// with its parent: at the child's centre of mass, along its motion. Where that lies on the axis of
/// a revolute joint, 0.1 m next to it. The parent counts as the world, with index kNoBody if it is
/// the world. Without friction; with the joint's load on the stop.
void find_limits(const World& world, int joint, double epsilon, std::vector<FoundContact>& found);

/// Index of the world itself as a side of a limit.
inline constexpr std::uint32_t kNoBody = 0xFFFFFFFF;

/// The same contact as one of the other body: the normal points to that.
FoundContact reversed(const FoundContact& contact, const World& world);

}  // namespace hlm::ve
