// All basic contacts of one pair of convex shapes within ε (docs/method.md 8.3), on the best of its
// separating axes or on all near ones.
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/geometry/convex.h"
#include "hlm/geometry/feature.h"
#include "hlm/geometry/separation.h"

namespace hlm::geometry {

/// One basic contact (vertex-face, face-vertex or edge-edge).
struct ManifoldPoint {
  Feature tool_feature;  ///< `shape` is left 0 for the caller.
  Feature body_feature;
  Vector3 p_WC = Vector3::Zero();  ///< Point on the environment's surface, world, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit, environment to tool.
  double separation = 0;           ///< True separation σ, m.
  std::uint16_t axis = 0;          ///< Which axis of the pair it is on; 0 is the best.
  /// What tells apart contacts of find_axes() between the same two features: of two edges that
  /// cross over a face, which face; kTellsApart and more on other axes. Otherwise 0.
  std::uint32_t face = 0;
};
inline constexpr std::uint32_t kTellsApart = std::uint32_t{1} << 31;
inline constexpr std::size_t kMaxManifoldPoints = 32;
using Manifold = StaticVector<ManifoldPoint, kMaxManifoldPoints>;
/// Most contacts on all near axes.
inline constexpr std::size_t kMaxAxesPoints = 4 * kMaxManifoldPoints;
using AxesManifold = StaticVector<ManifoldPoint, kMaxAxesPoints>;

/// Counts of answers that were refused, over the life of the caller's program.
struct ProximityStatistics {
  std::uint64_t queries = 0;
  std::uint64_t failures =
      0;  ///< Support check along the normal failed: no contact was made of it.
};

/// What find_contacts() has found of a pair, for the same question with another `before_B`.
struct KnownSeparation {
  bool is_known = false;
  std::optional<CoreSeparation> separation;  ///< None: farther apart than ε.
  Vector3 apart_B = Vector3::Zero();         ///< Then a unit normal with such a gap.
};

/// Contacts of `tool` at X_WT against `body` at X_WB with separation <= epsilon (m, >= 0); empty if
/// the shapes are farther apart. Separations are exact to 1e-6 m from -20 mm to epsilon.
/// `before_B`: the normal (body's frame) that the pair had a little earlier, if one shall be kept
/// to where they overlap (find_penetration_near); then the normal is near it, and separations are
/// along it. `may_allocate`: CorePair::may_allocate; without it nothing here does.
Manifold find_contacts(const Convex& tool, const Pose& X_WT, const Convex& body, const Pose& X_WB,
                       double epsilon, ProximityStatistics& statistics,
                       const std::optional<Vector3>& before_B = {}, bool may_allocate = true,
                       KnownSeparation* known = nullptr);

/// Contacts on all axes that can become the best while the tool moves by no more than epsilon: two
/// convex shapes are apart if any axis separates them. The least separation of an axis' contacts is
/// its gap: so on an axis with none over a face they are the shapes' outermost points, also beyond
/// the face's border. An axis within kOneAxis of an earlier load-bearing one bears no load: of
/// these only normals of the body's faces are listed, which tell whether the shapes are apart as
/// the tool turns.
AxesManifold find_axes(const Convex& tool, const Pose& X_WT, const Convex& body, const Pose& X_WB,
                       double epsilon, ProximityStatistics& statistics,
                       const std::optional<Vector3>& before_B = {}, bool may_allocate = true);

}  // namespace hlm::geometry
