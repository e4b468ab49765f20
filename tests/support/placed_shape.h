// A shape where it belongs, of meshes what a server makes of them there.
#pragma once

#include <memory>

#include "hlm/haptic_server/scene/placed_shape.h"

namespace hlm::test {

inline server::PlacedShape placed(const geometry::AnyShape& shape, const ContactSide& side,
                                  const Pose& X_BS = {}, const Friction& friction = {}) {
  const auto use =
      side.kind == SideKind::kWorld ? geometry::MeshUse::kSolids : geometry::MeshUse::kPieces;
  return {
      .shape = std::make_shared<const geometry::ShapeParts>(parts_of(shape, "of the test", use)),
      .side = side,
      .X_BS = X_BS,
      .friction = friction};
}

/// Of a tower, or what holds one.
inline server::PlacedShape rough_box(const Vector3& size, const ContactSide& side) {
  return placed(geometry::Shape(geometry::Box{size}), side, {}, {0.5});
}

}  // namespace hlm::test
