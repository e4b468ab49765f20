// Fewer contacts that hold the tool as well.
#pragma once

#include <optional>
#include <vector>

#include "hlm/geometry/feature.h"

namespace hlm::server {

/// Leaves at most `most` contacts, at most geometry::kMaxSelected: the deepest. Drops contacts near
/// a kept one that have a similar normal and the same two sides, widening "near" until the rest fit
/// or the work is spent (geometry::Work). With the normal of a planar tool's plane, only contacts
/// that constrain it there are left, one of those that differ only in their place along the normal.
/// Allocates nothing.
void thin_out(std::vector<geometry::FoundContact>& contacts,
              const std::optional<Vector3>& planar_normal_W, std::size_t most);

}  // namespace hlm::server
