// Which contacts are there within ε, of the virtual tool or of a body, with the rest of the world?
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include "hlm/geometry/contact_finder.h"
#include "hlm/ve_client/world/virtual_tool.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// How deep the tool overlaps something.
struct Overlap {
  double depth = 0;  ///< m.
  /// Overlap of any two shapes by more than a fifth of both thicknesses, or half of the tool's.
  bool is_through = false;
};

/// ε-active contact detection. Links of the tool touch each other too, except those that a joint
/// connects.
class Proximity {
 public:
  /// `world` outlives this.
  Proximity(World& world, const ToolAssembly& assembly);

  /// All contacts with σ <= epsilon (m, >= 0) in the present poses, on the best axis of each pair
  /// of shapes, in an order that depends on the world alone; the velocities are those of the
  /// bodies. Bodies and shapes are named by their index in the world's description; all bodies
  /// count as the world. Where the tool overlaps a movable body it stays on the side on which it
  /// was at the call before. Of two links the normal points to the one farther from the root, and
  /// the velocity is zero: both are the tool's. Valid until the next call.
  std::span<const FoundContact> query(const VirtualTool& tool, double epsilon);
  /// The contacts of a body that is not fixed, whose normals point to it, with all bodies that
  /// the engine lets it touch. Valid until the next call.
  std::span<const FoundContact> query(int body, double epsilon);
  /// The contacts for the world's next step, in which no point of the tool moves farther than
  /// `reach` (m, >= 0), with the bodies that stop the tool: of each pair of shapes on the best
  /// axis, or on one along which they are apart now and where the tool is drawn to. Valid until the
  /// next call.
  std::span<const ToolContact> within_reach(
      const VirtualTool& tool, double reach,
      const std::function<bool(int body)>& stops_tool = [](int) { return true; });
  /// The overlap of the tool with what stops it.
  Overlap overlap(const VirtualTool& tool, const std::function<bool(int body)>& stops_tool);

  /// Least extent of a shape of the tool, m.
  double thinnest() const noexcept { return thinnest_; }

  const ProximityStatistics& statistics() const noexcept { return finder_.statistics(); }

 private:
  void place_world();
  std::span<const FoundContact> find(const VirtualTool& tool, const ContactFinder::Search& search);
  double thickness_of(const CollisionId& id);

  World& world_;
  double thinnest_ = std::numeric_limits<double>::infinity();
  std::vector<int> tool_bodies_;
  ContactFinder finder_;
  unsigned long placed_at_ = std::numeric_limits<unsigned long>::max();  ///< World::changes().
  std::vector<FoundContact> contacts_;
  std::vector<ToolContact> within_reach_;
  std::map<CollisionId, double> thickness_;  ///< Thickness of what was overlapped, m.
};

}  // namespace hlm::ve
