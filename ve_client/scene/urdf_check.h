// What a URDF file loses on its way to SDF.
#pragma once

#include "hlm/scene/diagnostics.h"
#include "hlm/scene/sdf_file.h"

namespace hlm::ve {

/// Says what libsdformat's translation of a URDF file loses without a word, and mends in the file
/// what it does not bear. Whether the translation can begin; if not, it has been refused.
bool check_urdf(const SdfFile& file, Diagnostics& diagnostics);

}  // namespace hlm::ve
