// Which contacts of the tool are reported, out of all that were found on all axes of their pairs?
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "hlm/geometry/select.h"

namespace hlm::geometry {

/// Most contacts of the tool that are reported, on all axes: what is left is for those of bodies.
inline constexpr std::size_t kMostToolContacts = 2 * kMaxSelected;
static_assert(kMostToolContacts <= kMaxContacts);

/// The contacts to report: those that `selection` chooses of the best axes, then those on the other
/// axes of their pairs, the nearest pairs first. Of each pair all of the other axes are there or
/// none, for a server treats what is missing as no obstacle to the others.
///
/// A pair beyond `epsilon`, m, is there only if all of it fits into kMaxSelected contacts on best
/// axes and kMostToolContacts in all, the nearest pairs first; unless it is one with a side that
/// `stays`. The nearer ones compete as ContactSelection says.
std::vector<FoundContact> select_pairs(ContactSelection& selection, std::vector<FoundContact> found,
                                       double epsilon,
                                       const std::optional<Vector3>& planar_normal_W,
                                       const std::function<bool(const ContactSide&)>& stays);

}  // namespace hlm::geometry
