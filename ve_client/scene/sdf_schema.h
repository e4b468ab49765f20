// The part of the SDF format that is read, as libsdformat's parser wants it described.
#pragma once

#include <string>

#include <sdf/Element.hh>
#include <sdf/Types.hh>

#include "hlm/ve_client/scene/diagnostics.h"

namespace hlm::ve {

/// A new description of <sdf> with the elements that are used (element_rules()), taken from the
/// installed format, and our own. It differs from that where the parser would end at the first
/// fault: values are text, no attribute is required, and ranges are left to those who use them. It
/// is small, for the parser copies it for each element that it reads: a <model> within a <model> is
/// not part of it.
sdf::ElementPtr make_schema();

/// Whether the element of that path, as in element_rules(), has a value.
bool has_value(const std::string& path);

/// Refuses each value below `element` that is not what the format says: numbers that are not
/// finite, too few of them, words where there must be numbers. Sets it to its default, so that what
/// is left can be examined.
void check_values(const sdf::ElementPtr& element, Diagnostics& diagnostics);

}  // namespace hlm::ve
