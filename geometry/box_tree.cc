#include "hlm/geometry/box_tree.h"

#include <algorithm>
#include <numeric>

namespace hlm::geometry {
namespace {

constexpr std::size_t kLeaf = 4;

/// Twice a box's middle; of an unbounded one, somewhere.
double middle(const BoxTree::Box& box, Eigen::Index axis) {
  constexpr double kFar = 1e9;  // m
  return std::max(box.min()[axis], -kFar) + std::min(box.max()[axis], kFar);
}

}  // namespace

BoxTree::BoxTree(std::span<const Box> boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!boxes.empty()) build(boxes, 0, boxes.size());
}

std::size_t BoxTree::build(std::span<const Box> boxes, std::size_t first, std::size_t count) {
  const std::size_t index = nodes_.size();
  Node node{.box = {}, .first = first, .count = count};
  for (std::size_t i = first; i < first + count; ++i) node.box.extend(boxes[order_[i]]);
  nodes_.push_back(node);
  if (count <= kLeaf) return index;
  Eigen::Index axis = 0;
  node.box.sizes().maxCoeff(&axis);
  const std::size_t half = count / 2;
  const auto begin = order_.begin() + static_cast<std::ptrdiff_t>(first);
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half),
                   begin + static_cast<std::ptrdiff_t>(count), [&](std::size_t a, std::size_t b) {
                     return middle(boxes[a], axis) < middle(boxes[b], axis);
                   });
  build(boxes, first, half);
  const std::size_t right = build(boxes, first + half, count - half);
  nodes_[index].right = right;
  return index;
}

}  // namespace hlm::geometry
