// The geometry near the hand: shapes, the links and bodies that they belong to, and what they touch
// now (docs/method.md 18).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/common/tool_description.h"
#include "hlm/geometry/contact_finder.h"
#include "hlm/geometry/select.h"
#include "hlm/haptic_server/scene/mechanism.h"
#include "hlm/haptic_server/scene/placed_shape.h"

namespace hlm::server {

/// Throws std::invalid_argument with one line if the shape cannot be where it is said to be.
void require_place(const PlacedShape& shape, const ToolDescription& tool);

/// Made beside the loop, which takes long with many shapes; then it belongs to the loop, where it
/// allocates nothing. Its shapes do not change: another world is another scene.
class Scene {
 public:
  static constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

  /// shapes: as require_place() has them. apart: places in the list of pairs that never touch.
  /// Throws std::length_error with one line where most of very many shapes lie in one place.
  Scene(std::vector<PlacedShape> shapes,
        std::span<const std::pair<std::uint32_t, std::uint32_t>> apart, const ToolDescription& tool,
        std::span<const BodyInertia> inertias = {}, std::span<const BodyJoint> joints = {});
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Where a link is, or a body that it knows; without a pose it touches nothing. At first only the
  /// world has its place.
  void place(const ContactSide& side, const std::optional<Pose>& X_WB) noexcept;

  /// What is known of a body that the server may move; null: nothing.
  const BodyInertia* inertia(std::uint32_t body) const noexcept;
  /// What a body is in, as nothing moves it; null: no joint holds it.
  const Mechanism* mechanism(std::uint32_t body) const noexcept;
  /// Whether it may move any: what bears upon the tool is the server's then.
  bool holds() const noexcept { return !inertias_.empty(); }

  /// How far a link or body that it knows reaches from its origin, m; 0 of others.
  double reach(const ContactSide& side) const noexcept;

  /// Contacts of the tool within epsilon (m), sides named as in the shapes; each pair's on its best
  /// axis. The most telling if there are more than geometry::kMaxSelected, or than can be found
  /// with so much `work` (geometry::Work). Valid until forget().
  std::span<const geometry::FoundContact> of_tool(double epsilon,
                                                  std::uint64_t work = kUnlimited) noexcept;
  /// The same where the tool is about to be: the next search of of_tool() goes on from the one
  /// before.
  std::span<const geometry::FoundContact> of_tool_ahead(double epsilon,
                                                        std::uint64_t work = kUnlimited) noexcept;
  /// The same of a movable body with all except the tool. Empty for more than kMaxMovedBodies.
  std::span<const geometry::FoundContact> of_body(std::uint32_t id, double epsilon,
                                                  std::uint64_t work = kUnlimited) noexcept;
  void forget() noexcept { found_.clear(); }

  /// What the latest search left out.
  const geometry::FinderCut& cut() const noexcept { return finder_->cut(); }

  std::size_t shapes() const noexcept { return shapes_.size(); }
  std::size_t pieces() const noexcept { return piece_count_; }

 private:
  /// Shapes that move as one.
  struct Body {
    ContactSide side;
    bool is_placed = false;
    double reach = 0;                          ///< m.
    std::vector<std::uint32_t> shape_of = {};  ///< By piece: place in shapes_.
  };

  std::optional<std::size_t> find_body(const ContactSide& side) const noexcept;
  void gather_bodies();
  void make_finder();
  bool may_touch(const geometry::CollisionId& a, const geometry::CollisionId& b) const noexcept;
  std::span<const geometry::FoundContact> find(
      std::span<const int> bodies, const geometry::ContactFinder::Search& search) noexcept;

  std::vector<PlacedShape> shapes_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> apart_;  ///< Sorted, the smaller first.
  ToolDescription tool_;
  std::vector<BodyInertia> inertias_;  ///< By body.
  std::vector<Mechanism> mechanisms_;
  std::optional<Vector3> planar_normal_W_;
  std::vector<Body> bodies_;  ///< By side; their numbers in pieces_.
  std::vector<int> links_;    ///< Those of the tool.
  std::size_t piece_count_ = 0;
  std::unique_ptr<geometry::Pieces> pieces_;
  std::unique_ptr<geometry::ContactFinder> finder_;
  std::vector<geometry::FoundContact> telling_;  ///< Of the present search.
  std::vector<geometry::FoundContact> found_;
};

}  // namespace hlm::server
