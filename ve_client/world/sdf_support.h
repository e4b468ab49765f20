// Which elements of an SDF file this program understands.
#pragma once

#include <string>

#include <sdf/Element.hh>

#include "ve_client/world/diagnostics.h"

namespace hlm::ve {

/// Throws std::runtime_error at the first element below `root` (<sdf>) that would change how bodies
/// move or touch, but is not supported. The message names the element, where it is and what is
/// allowed there. Elements without such an effect (visuals, lights, sensors, plugins, …) pass.
void require_supported(const sdf::ElementPtr& root);

/// The element and its named ancestors, for example "model 'a' link 'b' collision 'c'".
std::string describe(sdf::ElementPtr element);

/// Where an element stands.
Place place_of(const sdf::ElementPtr& element);

}  // namespace hlm::ve
