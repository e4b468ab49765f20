#include "hlm/haptic_server/scene/join_boxes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

namespace hlm::server {
namespace {

/// Lengths (m), and components of a rotation, that differ by less are the same: rounding in a file.
/// Larger: steps that a fingertip feels go. Smaller: tiles whose places were worked out stay apart.
constexpr double kSame = 1e-6;

std::int64_t rounded(double x) { return std::llround(x / kSame); }

/// A box, or some that have become one, in the frame of their orientation.
struct Block {
  std::uint32_t place;      ///< Of the first one.
  Eigen::AlignedBox3d box;  ///< m.
  bool joined = false;
};

/// What boxes have in common that can become one.
auto kind_of(const PlacedShape& shape) {
  const Quaternion& q = shape.X_BS.R;
  const double sign = q.w() < 0 ? -1 : 1;
  const std::array rotation{rounded(sign * q.w()), rounded(sign * q.x()), rounded(sign * q.y()),
                            rounded(sign * q.z())};
  const Friction& friction = shape.friction;
  return std::tuple(shape.side, rotation, friction.coefficient, friction.rule, friction.priority,
                    shape.group, shape.mask);
}

/// Joins the blocks that are as wide and high as the one before them along an axis, and begin where
/// that ends at the latest. Returns whether any are.
bool join_along(int axis, std::vector<Block>& blocks) {
  const auto section = [axis](const Block& block) {
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    const Vector3& least = block.box.min();
    const Vector3& most = block.box.max();
    return std::array{rounded(least[u]), rounded(most[u]), rounded(least[v]), rounded(most[v])};
  };
  std::ranges::sort(blocks, {}, [&](const Block& block) {
    return std::tuple(section(block), block.box.min()[axis], block.place);
  });
  std::vector<Block> joined;
  for (const Block& block : blocks) {
    const bool goes_on = !joined.empty() && section(joined.back()) == section(block) &&
                         block.box.min()[axis] <= joined.back().box.max()[axis] + kSame;
    if (!goes_on) {
      joined.push_back(block);
      continue;
    }
    joined.back().box.extend(block.box);
    joined.back().place = std::min(joined.back().place, block.place);
    joined.back().joined = true;
  }
  const bool any = joined.size() < blocks.size();
  blocks = std::move(joined);
  return any;
}

/// Gives boxes of one kind the shapes of the blocks that they make.
void join(std::span<PlacedShape> shapes, std::span<const std::uint32_t> places) {
  const Quaternion R = shapes[places.front()].X_BS.R;
  std::vector<Block> blocks;
  for (const std::uint32_t place : places) {
    const Vector3 middle = R.conjugate() * shapes[place].X_BS.p;
    const Vector3 half = shapes[place].shape->pieces.front().half_extents();
    blocks.push_back({.place = place, .box = {middle - half, middle + half}});
  }
  for (int tried = 0, axis = 0; tried < 3; axis = (axis + 1) % 3) {
    tried = join_along(axis, blocks) ? 0 : tried + 1;
  }
  if (blocks.size() == places.size()) return;
  std::set<std::uint32_t> gone(places.begin(), places.end());
  for (const Block& block : blocks) {
    gone.erase(block.place);
    if (!block.joined) continue;
    const geometry::Shape box = geometry::Box{block.box.sizes()};
    shapes[block.place].shape =
        std::make_shared<const geometry::ShapeParts>(geometry::parts_of(box, "of boxes"));
    shapes[block.place].X_BS = {R * Vector3(block.box.center()), R};
  }
  for (const std::uint32_t place : gone) shapes[place].shape = nullptr;
}

}  // namespace

void join_boxes(std::span<PlacedShape> shapes,
                std::span<const std::pair<std::uint32_t, std::uint32_t>> apart) {
  std::set<std::uint32_t> named;
  for (const auto& [a, b] : apart) named.insert({a, b});
  std::map<decltype(kind_of(shapes.front())), std::vector<std::uint32_t>> kinds;
  for (std::uint32_t place = 0; place < shapes.size(); ++place) {
    const auto& pieces = shapes[place].shape->pieces;
    if (pieces.size() != 1 || !pieces.front().is_box() || named.contains(place)) continue;
    kinds[kind_of(shapes[place])].push_back(place);
  }
  for (const auto& [kind, places] : kinds) join(shapes, places);
}

}  // namespace hlm::server
