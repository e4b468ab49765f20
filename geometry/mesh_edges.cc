#include "hlm/geometry/mesh_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "hlm/geometry/interruption.h"

namespace hlm::geometry {

MeshEdges::MeshEdges(const std::vector<Corners>& triangles) : triangles_(triangles) {
  halves_.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]);
      halves_.push_back({std::uint64_t{low} << 32 | high, static_cast<std::uint32_t>(3 * t + i)});
    }
  }
  interruption_point();
  std::ranges::sort(halves_, {}, [](const Half& half) { return std::pair(half.ends, half.place); });
  interruption_point();
  counts_.resize(halves_.size());
  for (std::size_t first = 0; first < halves_.size();) {
    std::size_t end = first;
    while (end < halves_.size() && halves_[end].ends == halves_[first].ends) ++end;
    for (std::size_t k = first; k < end; ++k) {
      counts_[halves_[k].place] = static_cast<std::uint32_t>(end - first);
    }
    if (end - first == 1) ++open_;
    if (end - first > 2) ++crowded_;
    first = end;
  }
}

std::vector<std::array<std::int32_t, 3>> MeshEdges::across() const {
  std::vector<std::array<std::int32_t, 3>> across(triangles_.size(), {-1, -1, -1});
  for_each_pair([&](std::size_t t, std::size_t i, std::size_t u, std::size_t j) {
    if (triangles_[t][i] == triangles_[u][j]) return;  // Both run the same way.
    across[t][i] = static_cast<std::int32_t>(u);
    across[u][j] = static_cast<std::int32_t>(t);
  });
  return across;
}

std::vector<std::array<std::int32_t, 3>> MeshEdges::across(
    const std::vector<Vector3>& points) const {
  auto across = this->across();
  struct Side {
    double angle;  ///< About the edge, rad.
    bool leaves;   ///< Solid lies before it in that direction, not behind it.
    std::uint32_t place;
  };
  constexpr double kSameAngle = 1e-6;
  std::vector<Side> around;
  for_each_crowded([&](const std::vector<std::uint32_t>& places) {
    const auto end_of = [&](std::uint32_t place, std::uint32_t step) {
      return triangles_[place / 3][(place % 3 + step) % 3];
    };
    const std::uint32_t first = std::min(end_of(places[0], 0), end_of(places[0], 1));
    const std::uint32_t last = std::max(end_of(places[0], 0), end_of(places[0], 1));
    const Vector3& a = points[first];
    const Vector3 along = (points[last] - a).normalized();
    const auto away = [&](std::uint32_t place) -> Vector3 {
      const Vector3 v = points[end_of(place, 2)] - a;
      return v - v.dot(along) * along;
    };
    const Vector3 x = away(places[0]).normalized();
    const Vector3 y = along.cross(x);
    around.clear();
    for (const std::uint32_t place : places) {
      const Vector3 v = away(place);
      double angle = std::atan2(y.dot(v), x.dot(v));
      if (angle < -kSameAngle) angle += 2 * std::numbers::pi;
      around.push_back({std::max(angle, 0.0), end_of(place, 0) == first, place});
    }
    std::ranges::sort(around, {},
                      [](const Side& side) { return std::pair(side.angle, side.place); });
    for (std::size_t i = 1; i < around.size(); ++i) {  // Of two walls on each other the first ends.
      const bool same = around[i].angle - around[i - 1].angle < kSameAngle;
      if (same && around[i].leaves && !around[i - 1].leaves) std::swap(around[i], around[i - 1]);
    }
    for (std::size_t i = 0; i < around.size(); ++i) {
      const Side& from = around[i];
      const Side& to = around[(i + 1) % around.size()];
      if (from.leaves || !to.leaves) continue;
      across[from.place / 3][from.place % 3] = static_cast<std::int32_t>(to.place / 3);
      across[to.place / 3][to.place % 3] = static_cast<std::int32_t>(from.place / 3);
    }
  });
  return across;
}

}  // namespace hlm::geometry
