// Where does a tool go that obstacles hold back in the engine while its proxy has passed them?
#pragma once

#include <functional>

#include "hlm/ve_client/world/proximity.h"
#include "hlm/ve_client/world/virtual_tool.h"

namespace hlm::ve {

/// After a frame, the tool read back: carries it straight to its proxy, else it would find contacts
/// where the proxy is not, and none where it is. It is carried if it is held back by more than 4 mm
/// beyond what the proxy is pressed in, and is nowhere on the way through what stops it: never
/// through a wall, whatever the proxy did. Not farther than 40 times its least extent.
void catch_up(VirtualTool& tool, Proximity& proximity,
              const std::function<bool(int body)>& stops_tool);

}  // namespace hlm::ve
