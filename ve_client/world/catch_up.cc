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
constexpr int kMostSteps = 400;
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
  int left = kMostSteps;
  const auto passes = [&](const Configuration& from, const Configuration& to) {
    tool.place(from);
    const int steps =
        static_cast<int>(std::ceil(tool.distance_to(to) / (kStep * proximity.thinnest())));
    left -= steps;
    for (int i = 1; left >= 0 && i <= steps; ++i) {
      if (overlap_at(tool.between(from, to, static_cast<double>(i) / steps)).is_through) {
        return false;
      }
    }
    return left >= 0;
  };

  if (way_.size() < kLongestWay) way_.push_back(there);
  const Overlap overlap = overlap_at(there);
  bool free = !overlap.is_through && lag > kMostLag + overlap.depth;
  Configuration at = here;
  for (auto to = way_.begin(); free && to != way_.end(); ++to) {
    free = passes(at, *to);
    at = *to;
  }
  free = free && passes(at, there);
  tool.place(free ? tool.between(here, there, 1) : here);
  if (free) way_.clear();
}

}  // namespace hlm::ve
