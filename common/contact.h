// A contact between the virtual tool and the virtual environment, as the environment reports it.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>

#include "common/spatial.h"
#include "common/static_vector.h"

namespace hlm {

/// Largest number of contacts in one update.
inline constexpr std::size_t kMaxContacts = 64;

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

/// Identity of a contact: the feature pair. It is the same from frame to frame, whichever of the
/// two bodies a collision detector takes as its reference.
struct ContactKey {
  std::uint16_t link = 0;  ///< Link of the virtual tool.
  Feature tool_feature;    ///< Feature of that link.
  std::uint32_t body = 0;  ///< Body of the virtual environment.
  Feature body_feature;    ///< Feature of that body.

  auto operator<=>(const ContactKey&) const = default;
};

/// One active (separation <= 0) or ε-active (0 < separation <= ε) contact.
struct ReportedContact {
  ContactKey key;
  Vector3 p_WC = Vector3::Zero();  ///< Point on the environment (the local constraint), world, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal from the environment to the tool, world.
  double separation = 0;  ///< True separation σ, m; negative when the true shapes overlap.
  Vector3 v_WC = Vector3::Zero();  ///< Velocity of the environment's point, world, m/s.
};

using ReportedContacts = StaticVector<ReportedContact, kMaxContacts>;

}  // namespace hlm
