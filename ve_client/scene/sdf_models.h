// Conversion of SDFormat's models to ours.
#pragma once

#include <sdf/Model.hh>

#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// Adds a top-level model, with its links, joints and nested models. What cannot be used is
/// refused; the rest is added nevertheless, so that it can be examined.
void add_model(const sdf::Model& model, WorldDescription& world, Diagnostics& diagnostics);

}  // namespace hlm::ve
