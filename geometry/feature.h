// What a contact lies on, and the identity that follows from it.
#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <tuple>

#include "hlm/common/contact.h"

namespace hlm::geometry {

/// Names one collision shape of a world: by its body and its place in there.
struct CollisionId {
  int body = 0;
  int shape = 0;

  auto operator<=>(const CollisionId&) const = default;
};

/// Part of a shape that takes part in a basic contact.
enum class FeatureKind : std::uint8_t { kVertex = 0, kEdge = 1, kFace = 2 };

/// A feature of a body. Stable from frame to frame: the same vertex of the same shape has the same
/// value however the bodies move.
struct Feature {
  FeatureKind kind = FeatureKind::kVertex;
  std::uint16_t index = 0;  ///< Which vertex, edge or face of the shape.
  std::uint32_t shape = 0;  ///< Which convex shape of the body.

  constexpr Feature() = default;
  constexpr Feature(FeatureKind kind_, std::uint32_t shape_, std::uint16_t index_)
      : kind(kind_), index(index_), shape(shape_) {}

  bool operator==(const Feature&) const = default;
  auto operator<=>(const Feature& other) const {
    return std::tie(kind, shape, index) <=> std::tie(other.kind, other.shape, other.index);
  }
};

/// The side whose flat face a contact lies on, by its features on side a and side b.
constexpr PlaneOwner plane_of(const Feature& a, const Feature& b) noexcept {
  return a.kind == FeatureKind::kFace && b.kind != FeatureKind::kFace ? PlaneOwner::kA
                                                                      : PlaneOwner::kB;
}

/// In ContactKey::face: the tool is over no piece of a surface there, but next to the one of the
/// pair. Each such piece has a contact of its own: only its other axes tell whether the tool is
/// still next to it.
inline constexpr std::uint32_t kBeside = std::uint32_t{1} << 30;

/// The feature pair of a contact. It is the same from frame to frame, whichever of the two bodies a
/// collision detector takes as its reference.
struct ContactKey {
  /// The side that the normal points to: a link of the tool, or a body by its index in the world.
  ContactSide a{SideKind::kToolLink, 0};
  Feature a_feature;
  ContactSide b;  ///< A body by its index in the world, or a link of the tool.
  Feature b_feature;
  std::uint32_t face = 0;  ///< ManifoldPoint::face, or with kBeside.

  auto operator<=>(const ContactKey&) const = default;
};

/// The contact's identity on the wire: a hash of the pair, so that two pairs of a world have the
/// same one with a probability of 1e-19 each. It does not depend on whether a body is movable.
std::uint64_t identity_of(const ContactKey& key) noexcept;
/// The same of the two convex shapes alone.
std::uint32_t pair_of(const ContactKey& key) noexcept;

/// A contact that was found.
struct FoundContact {
  ContactKey key;
  Vector3 p_WC = Vector3::Zero();  ///< Point on b, world, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal from b to a, world.
  double separation = 0;           ///< True separation σ, m; negative when the shapes overlap.
  Vector3 v_WC = Vector3::Zero();  ///< Velocity of b's point, world, m/s.
  double friction = -1;            ///< μ of the two materials; negative: neither says.
  double load = 0;                 ///< Present normal force of a contact without the tool, N.
  std::uint32_t pair = 0;          ///< Pair of the two pieces for which it was found (pair_of);
  CollisionId own;                 ///< that of side a,
  CollisionId other;               ///< that of side b.
  std::uint16_t axis = 0;          ///< Which axis of its pair it is on; 0 is the best.
  PlaneOwner plane = PlaneOwner::kB;
};

/// Whether both are of one pair, or neither is next to its piece: else they differ however
/// near they are.
inline bool may_be_same(const FoundContact& x, const FoundContact& y) noexcept {
  return x.pair == y.pair || ((x.key.face | y.key.face) & kBeside) == 0;
}

/// The contacts as they are reported to the server; at most kMaxContacts.
ReportedContacts reports_of(std::span<const FoundContact> contacts) noexcept;

}  // namespace hlm::geometry
