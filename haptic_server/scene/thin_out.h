// Fewer contacts that hold the tool as well.
#pragma once

#include <optional>
#include <vector>

#include "hlm/geometry/feature.h"

namespace hlm::server {

/// Leaves of a planar tool's contacts those that constrain it in its plane, one of those that
/// differ only in their place along its normal. Allocates nothing.
void keep_planar(std::vector<geometry::FoundContact>& contacts, const Vector3& planar_normal_W);

/// Leaves at most `most` contacts: the deepest, and of those that lie so near to one that stays,
/// with about its normal and its two sides, as it takes, none. Allocates nothing.
void thin_out(std::vector<geometry::FoundContact>& contacts, std::size_t most);

}  // namespace hlm::server
