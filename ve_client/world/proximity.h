// Which contacts are there within ε, of the virtual tool or of a body, with the rest of the world?
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hlm/geometry/convex.h"
#include "hlm/geometry/feature.h"
#include "hlm/geometry/manifold.h"
#include "hlm/geometry/seams.h"
#include "hlm/world/virtual_tool.h"
#include "hlm/world/world.h"

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
  /// of shapes or on all near ones (find_axes()), in an order that depends on the world alone; the
  /// velocities are those of the bodies. Bodies and shapes are named by their
  /// index in the world's description; all bodies count as the world. Where the tool overlaps a
  /// movable body it stays on the side on which it was at the call before. Of two links the normal
  /// points to the one farther from the root, and the velocity is zero: both are the tool's. Valid
  /// until the next call.
  /// ahead: the axes are also those that matter while the tool moves as its target did, s.
  std::span<const FoundContact> query(const VirtualTool& tool, double epsilon,
                                      bool all_axes = false, double ahead = 0);
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

  const ProximityStatistics& statistics() const noexcept { return statistics_; }

 private:
  struct ToolShape {
    int link = 0;
    CollisionId id;
  };

  /// Shapes of links that can touch each other.
  struct ToolPair {
    ToolShape a;
    ToolShape b;
  };

  /// A shape of the tool or of a body, and one that it is near.
  struct Pair {
    ContactSide side;  ///< Whose `id` is.
    CollisionId id;
    CollisionId other;
    Pose X_WG;
    Pose X_WO;
    Vector3 travel_W = Vector3::Zero();  ///< How far it is about to move, m; 0: not asked.
    bool keeps_side = false;             ///< The tool stays on its side of a movable body.
    bool passes_beside = false;          ///< A planar tool may be beside it for good.
  };

  void query_tool_pair(const VirtualTool& tool, const ToolPair& pair, double epsilon);
  void query_shape(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                   const Vector3& v_W, double epsilon);
  double thickness_of(const CollisionId& id);
  void resolve(const PairSide& a, const PairSide& b, std::size_t first);
  void merge();
  void query_pair(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                  const Vector3& v_W, const CollisionId& other, double epsilon);
  double add_contacts(const Pair& pair, double epsilon, const std::optional<Vector3>& near_O);

  /// Normals between shapes of the tool and of movable bodies, in the frame of the body's shape.
  using Sides = std::map<std::pair<CollisionId, CollisionId>, Vector3>;

  /// Contacts of a pair of shapes, without what the world knows of it.
  AxesManifold find(const CollisionId& a, const Pose& X_WA, const CollisionId& b, const Pose& X_WB,
                    double epsilon, const std::optional<Vector3>& before_B = {},
                    const Vector3& travel_W = Vector3::Zero());

  World& world_;
  std::optional<Vector3> planar_normal_W_;
  double thinnest_ = std::numeric_limits<double>::infinity();
  bool all_axes_ = false;
  double ahead_ = 0;  ///< s.
  /// Whether a pair overlapped by more than what is pressed in at an internal edge, and has no
  /// contact: a narrow tool is deep in two pieces, past the sides on which they adjoin.
  bool lost_ = false;
  std::vector<int> tool_bodies_;
  std::vector<ToolShape> tool_shapes_;
  std::vector<ToolPair> tool_pairs_;
  std::vector<CollisionId> near_;
  std::vector<FoundContact> contacts_;
  bool shared_ = false;  ///< Whether pieces may have found the same contact.
  std::vector<ToolContact> within_reach_;
  Sides sides_before_;                       ///< Sides at the query of the tool before.
  Sides sides_;                              ///< Sides at the present or latest one.
  std::map<CollisionId, double> thickness_;  ///< Thickness of what was overlapped, m.
  ProximityStatistics statistics_;
};

}  // namespace hlm::ve
