// Where does a tool go that obstacles hold back in the engine while its proxy has passed them?
#pragma once

#include <functional>
#include <vector>

#include "ve_client/world/proximity.h"
#include "ve_client/world/virtual_tool.h"

namespace hlm::ve {

/// Carries it to its proxy, straight or along the way that the proxy has taken: else it would find
/// contacts where the proxy is not, and none where it is.
class CatchUp {
 public:
  /// After a frame, the tool read back. It is carried if it is held back by more than 4 mm beyond
  /// what the proxy is pressed in, and is nowhere on the way through what stops it: never through a
  /// wall, whatever the proxy did. Not farther in a frame than 40 times the tool's least extent.
  void update(VirtualTool& tool, Proximity& proximity,
              const std::function<bool(int body)>& stops_tool);

 private:
  std::vector<Configuration> way_;  ///< Of the proxy since the tool was with it.
};

}  // namespace hlm::ve
