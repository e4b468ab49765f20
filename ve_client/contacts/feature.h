// What a contact lies on, and the identity that follows from it.
#pragma once

#include <compare>
#include <cstdint>
#include <span>

#include "common/contact.h"

namespace hlm::ve {

/// Part of a shape that takes part in a basic contact.
enum class FeatureKind : std::uint8_t { kVertex = 0, kEdge = 1, kFace = 2 };

/// A feature of a body. Stable from frame to frame: the same vertex of the same shape has the same
/// value however the bodies move.
struct Feature {
  FeatureKind kind = FeatureKind::kVertex;
  std::uint8_t shape = 0;   ///< Which convex shape of the body.
  std::uint16_t index = 0;  ///< Which vertex, edge or face of that shape.

  auto operator<=>(const Feature&) const = default;
};

/// The feature pair of a contact. It is the same from frame to frame, whichever of the two bodies a
/// collision detector takes as its reference.
struct ContactKey {
  std::uint16_t link = 0;  ///< Link of the virtual tool.
  Feature tool_feature;    ///< Feature of that link.
  std::uint32_t body = 0;  ///< Body of the virtual environment.
  Feature body_feature;    ///< Feature of that body.

  auto operator<=>(const ContactKey&) const = default;
};

/// The contact's identity on the wire: a hash of the pair, so that two pairs of a world have the
/// same one with a probability of 1e-19 each.
std::uint64_t identity_of(const ContactKey& key) noexcept;
/// The same of the two convex shapes alone.
std::uint32_t pair_of(const ContactKey& key) noexcept;

/// A contact that was found.
struct FoundContact {
  ContactKey key;
  Vector3 p_WC = Vector3::Zero();  ///< Point on the environment, world, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal from the environment to the tool, world.
  double separation = 0;           ///< True separation σ, m; negative when the shapes overlap.
  Vector3 v_WC = Vector3::Zero();  ///< Velocity of the environment's point, world, m/s.
};

/// As they are reported to the server; at most kMaxContacts.
ReportedContacts reports_of(std::span<const FoundContact> contacts) noexcept;

}  // namespace hlm::ve
