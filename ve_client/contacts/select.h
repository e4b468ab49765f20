// Which contacts are reported, out of all that were found?
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "ve_client/contacts/feature.h"

namespace hlm::ve {

/// Most contacts that are reported. More cost the server time; fewer no longer hold a large face.
inline constexpr std::size_t kMaxSelected = 64;

/// The contacts to report, at most kMaxSelected, sorted by key. They depend on the set of
/// candidates alone, not on their order. If there are more, the smallest separations stay, and of
/// those that differ by less than a millimetre the ones that lie farthest apart: the corners of a
/// face before its middle.
///
/// `planar_normal_W`: unit normal of the plane of motion of a planar tool, none for other tools.
/// For such a tool a contact whose normal is that of the plane constrains nothing and is left out,
/// and contacts of one link with one body that are equal except for a shift along the plane's
/// normal are one constraint: the one with the smallest key stays.
std::vector<FoundContact> select_contacts(std::span<const FoundContact> candidates,
                                          const std::optional<Vector3>& planar_normal_W);

}  // namespace hlm::ve
