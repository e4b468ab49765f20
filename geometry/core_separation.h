// What is known of how far apart two cores are, or how deep they overlap.
#pragma once

#include <cmath>
#include <optional>

#include "hlm/geometry/gjk.h"
#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {

/// Points of the two cores that realise a separation, p_tool - p_body = gap n_B.
struct Witness {
  Vector3 p_tool = Vector3::Zero();  ///< Point on the tool in B, m.
  Vector3 p_body = Vector3::Zero();  ///< Point on the body in B, m.
};

/// Signed distance of the cores along its normal. Invariant: gap == CorePair::gap(n_B), and no
/// normal has a gap larger than `upper`.
struct CoreSeparation {
  double gap = 0;                  ///< m; the shapes' separation is this minus both margins.
  double upper = 0;                ///< Upper bound of the signed distance, m.
  Vector3 n_B = Vector3::Zero();   ///< Unit, body to tool.
  std::optional<Witness> nearest;  ///< Where the search for the distance has found it, too.

  /// True if the supports along n_B confirm the distance. False for anything not finite.
  bool is_confirmed() const noexcept {
    return std::abs(upper - gap) <= narrow::kAccuracy && n_B.allFinite();
  }
};

}  // namespace hlm::geometry
