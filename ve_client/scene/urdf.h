// URDF files, rewritten as SDFormat.
#pragma once

#include "hlm/ve_client/scene/sdf_document.h"

namespace hlm::ve {

/// Rewrites the <robot> of a URDF file, in place, as a <model> of SDFormat. Links that fixed joints
/// join become one, with the sum of their masses; the link `world`, and a root without mass, stay
/// fixed to the world. Reports what this loses. False if the file is refused.
bool rewrite_urdf(SdfFile& file, Diagnostics& diagnostics);

}  // namespace hlm::ve
