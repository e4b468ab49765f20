// ve_client --check: what of a world's file would be used.
#pragma once

#include <ostream>

#include "hlm/ve_client/run/settings.h"

namespace hlm::ve {

/// Writes what the world of the settings holds, and all that is refused, approximated or ignored in
/// it, with file, line and element. Its tool is checked if there is one. Whether it can be used.
bool check_scene(const Settings& settings, std::ostream& out);

}  // namespace hlm::ve
