#include "hlm/ve_client/world/catch_up.h"

#include <cmath>

namespace hlm::ve {
namespace {

/// How far the tool may be held back from the proxy, besides what that is pressed in, m.
constexpr double kMostLag = 0.004;
/// A step of the way, in least extents of the tool: between two steps nothing of any thickness goes
/// from one side of it to the other. And most steps in a frame: each costs a query.
constexpr double kStep = 0.1;
constexpr double kMostSteps = 400;

}  // namespace

void catch_up(VirtualTool& tool, Proximity& proximity,
              const std::function<bool(int body)>& stops_tool) {
  const double lag = tool.lag();
  if (lag <= kMostLag) return;
  const double steps = std::ceil(lag / (kStep * proximity.thinnest()));
  if (!(steps <= kMostSteps)) return;
  const Configuration here = tool.q();
  const auto overlap_at = [&](double share) {
    tool.place(tool.on_the_way(here, share));
    return proximity.overlap(tool, stops_tool);
  };
  const Overlap last = overlap_at(1);
  bool passes = !last.is_through && lag > kMostLag + last.depth;
  for (double i = 1; passes && i < steps; ++i) passes = !overlap_at(i / steps).is_through;
  tool.place(passes ? tool.on_the_way(here, 1) : here);
}

}  // namespace hlm::ve
