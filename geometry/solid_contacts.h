// The contacts of a convex shape with a solid of triangles (docs/method/detection.md 8.6).
#pragma once

#include <cstdint>

#include "hlm/common/static_vector.h"
#include "hlm/geometry/convex.h"
#include "hlm/geometry/mesh_solid.h"

namespace hlm::geometry {

/// A contact of a tool, a convex shape, with a solid, in the solid's frame S.
struct SolidContact {
  Feature tool_feature;                         ///< `shape` is left 0 for the caller.
  FeatureKind solid_kind = FeatureKind::kFace;  ///< Of the solid: a triangle, an edge (3 times a
  std::uint32_t solid_feature = 0;              ///< triangle, and which), or a point.
  Vector3 p_S = Vector3::Zero();                ///< Point on the solid, m.
  Vector3 n_S = Vector3::UnitZ();               ///< Unit, solid to tool.
  double separation = 0;                        ///< m.
  /// At an edge or a corner of the solid: the normal of the triangle there that is nearest to n_S,
  /// and the direction along it to which n_S leans. Zero: it does not.
  Vector3 face_S = Vector3::Zero();
  Vector3 beyond_S = Vector3::Zero();
};
/// Most contacts of a pair; of more the deepest stay.
inline constexpr std::size_t kMaxSolidContacts = 64;
using SolidContacts = StaticVector<SolidContact, kMaxSolidContacts>;

/// What of a solid's surface is also that of all that it is a part of: the rest is no way out.
class OpenSurface {
 public:
  virtual bool has(const SolidContact& contact) const noexcept = 0;

 protected:
  ~OpenSurface() = default;
};

/// What is known of a pair from the search before, so that it stays on the side on which it was.
struct SolidMemory {
  /// A contact that overlapped.
  struct Pressed {
    Feature tool_feature;
    Vector3 p_S = Vector3::Zero();
    Vector3 n_S = Vector3::Zero();
  };
  double side = 0;   ///< Of a sheet: +1 before its front, -1 behind it; 0: not known.
  double depth = 0;  ///< Deepest overlap, m.
  StaticVector<Pressed, 8> pressed;
};

/// Contacts of `tool` at X_ST with a solid, with separation <= epsilon (m, >= 0), by features: the
/// tool's lowest points over triangles, sharp vertices and edges of the solid against the tool. One
/// counts if no neighbour of its feature is nearer along its normal, and nothing else of the solid
/// lies between. `before`: of the search before, null if there was none; `now`: set, of this one.
/// `open`: null if all of the surface is. Allocates nothing.
SolidContacts find_solid_contacts(const Convex& tool, const Pose& X_ST, const MeshSolid& solid,
                                  double epsilon, const SolidMemory* before, SolidMemory& now,
                                  const OpenSurface* open = nullptr) noexcept;

}  // namespace hlm::geometry
