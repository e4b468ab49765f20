#include "ve_client/world/catch_up.h"

#include <algorithm>
#include <cmath>

namespace hlm::ve {
namespace {

/// How far the tool may be held back from the proxy, besides what that is pressed in, m.
constexpr double kMostLag = 0.004;
/// A step of the way, in least extents of the tool: between two steps nothing of any thickness goes
/// from one side of it to the other.
constexpr double kStep = 0.1;
/// Most steps in a frame, of some 20 µs each, and most frames that a way lasts.
constexpr double kMostSteps = 400;
constexpr std::size_t kLongestWay = 200;

}  // namespace

void CatchUp::update(VirtualTool& tool, Proximity& proximity,
                     const std::function<bool(int body)>& stops_tool) {
  const double lag = tool.lag();
  if (lag <= kMostLag) {
    way_.clear();
    return;
  }
  const Configuration here = tool.q();
  const Configuration there = tool.target();
  const auto overlap_at = [&](const Configuration& q) {
    tool.place(q);
    return proximity.overlap(tool, stops_tool);
  };
  double left = kMostSteps;
  const auto passes = [&](const Configuration& from, const Configuration& to) {
    tool.place(from);
    const double steps = std::ceil(tool.distance_to(to) / (kStep * proximity.thinnest()));
    if (!(steps <= left)) return false;
    left -= steps;
    for (double i = 1; i <= steps; ++i) {
      if (overlap_at(tool.between(from, to, i / steps)).is_through) return false;
    }
    return true;
  };
  const auto passes_along_the_way = [&] {
    Configuration at = here;
    for (const Configuration& to : way_) {
      if (!passes(at, to)) return false;
      at = to;
    }
    return passes(at, there);
  };

  if (way_.size() < kLongestWay) way_.push_back(there);
  const Overlap overlap = overlap_at(there);
  const bool free = !overlap.is_through && lag > kMostLag + overlap.depth &&
                    (passes(here, there) || passes_along_the_way());
  tool.place(free ? tool.between(here, there, 1) : here);
  if (free) way_.clear();
}

}  // namespace hlm::ve
