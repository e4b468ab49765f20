// A tree of boxes that stand still among each other.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Geometry>

namespace hlm::geometry {

/// Made once; what is asked of it allocates nothing. Boxes are named by their place in the list
/// that it was made of.
class BoxTree {
 public:
  using Box = Eigen::AlignedBox3d;

  BoxTree() = default;
  /// Boxes may be unbounded.
  explicit BoxTree(std::span<const Box> boxes);

  /// Calls `use(place)` for the boxes that `enters(box)`, and possibly for some of their
  /// neighbours: in a fixed order.
  template <class Enters, class Use>
  void visit(const Enters& enters, const Use& use) const {
    std::array<std::size_t, kMostOpen> open;
    std::size_t count = 0;
    if (!nodes_.empty()) open[count++] = 0;
    while (count > 0) {
      const std::size_t index = open[--count];
      const Node& node = nodes_[index];
      if (!enters(node.box)) continue;
      if (node.right == 0) {
        for (std::size_t i = node.first; i < node.first + node.count; ++i) use(order_[i]);
      } else {
        open[count++] = node.right;
        open[count++] = index + 1;
      }
    }
  }

  /// The box around all of them; empty if there are none.
  Box bounds() const { return nodes_.empty() ? Box() : nodes_.front().box; }

 private:
  /// Halved at each level, a tree of 2^62 boxes is no deeper.
  static constexpr std::size_t kMostOpen = 64;

  struct Node {
    Box box;
    std::size_t first = 0;  ///< First of its boxes in order_.
    std::size_t count = 0;
    std::size_t right = 0;  ///< The left child is the next node; 0: a leaf.
  };

  std::size_t build(std::span<const Box> boxes, std::size_t first, std::size_t count);

  std::vector<std::size_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace hlm::geometry
