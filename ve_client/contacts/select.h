// Which contacts are reported, out of all that were found?
#pragma once

#include <optional>
#include <span>

#include "common/contact.h"

namespace hlm::ve {

/// The contacts to report, at most kMaxContacts of the smallest separations, sorted by key. They
/// depend on the set of candidates alone, not on their order.
///
/// `planar_normal_W`: unit normal of the plane of motion of a planar tool, none for other tools.
/// For such a tool a contact whose normal is that of the plane constrains nothing and is left out,
/// and contacts of one link with one body that are equal but for a shift along the plane's normal
/// are one constraint: the one with the smallest key stays.
ReportedContacts select_contacts(std::span<const ReportedContact> candidates,
                                 const std::optional<Vector3>& planar_normal_W);

}  // namespace hlm::ve
