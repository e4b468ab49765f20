// Internal edges: which contacts of a pair lie where an adjoining piece continues the surface, and
// which on a surface of several pieces (docs/method.md 8.5)? The name and the problem are those of
// Terdiman, Contact generation for meshes.
#pragma once

#include <vector>

#include "hlm/geometry/feature.h"
#include "hlm/geometry/manifold.h"
#include "hlm/geometry/pieces.h"

namespace hlm::geometry {

/// A contact of two shapes: `a` is the side its normal points to. Without velocity, friction, load.
FoundContact found_contact(const ManifoldPoint& point, const ContactSide& a,
                           const CollisionId& shape_a, const ContactSide& b,
                           const CollisionId& shape_b);

/// One of the two shapes of a pair, in its present pose.
struct PairSide {
  const Piece& piece;
  Pose X_WG;
};

/// Keeps the contacts of one pair, from `first` on, that are on a surface of the pieces
/// that are fixed to either shape; where the best axis is no surface's, the next one may take its
/// place. Their normals are some of that surface, and those of a corner over a surface of several
/// pieces have the same key on each of them. Returns whether other pairs may have the same
/// contacts: then merge_same() is needed. Allocates nothing.
bool remove_internal_edges(const Pieces& pieces, const PairSide& a, const PairSide& b,
                           std::vector<FoundContact>& contacts, std::size_t first);

}  // namespace hlm::geometry
