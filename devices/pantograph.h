// Kinematics of a pantograph: a five-bar linkage in the plane, driven at both ends of its base.
#pragma once

#include <optional>

#include "hlm/common/spatial.h"

namespace hlm::server {

using Vector2 = Eigen::Vector2d;
using Matrix2 = Eigen::Matrix2d;

/// Joint 0 is at the origin, joint 1 at (base, 0). From each an upper arm leads to an elbow, and a
/// forearm from each elbow to the handle, which is on the left of the way from elbow 0 to elbow 1
/// (Campion, Wang, Hayward, "The Pantograph Mk-II", IROS 2005). Lengths in m, above 0 except base.
/// If the joints are side by side, the handle at rest is at positive y.
struct Pantograph {
  double base = 0.038;
  double upper_arm = 0.07;
  double forearm = 0.09;

  /// Where the handle is.
  struct Handle {
    Vector2 p;  ///< m.
    /// ∂p/∂θ, m/rad: v = J θ', and a force f at the handle needs the torques Jᵀ f.
    Matrix2 J;
  };
  /// θ: angles of the upper arms, rad, from the x axis. Empty where the forearms do not meet, or
  /// lie in one line, so that the handle is not held in one direction.
  std::optional<Handle> handle(const Vector2& theta) const noexcept;

  /// Angles with the handle at p and the elbows outwards; empty where the arms do not reach.
  std::optional<Vector2> angles(const Vector2& p) const noexcept;
};

}  // namespace hlm::server
