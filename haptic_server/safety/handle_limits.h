// How fast and how far the handle may be moved, by whomever.
#pragma once

#include <array>

#include "hlm/common/range.h"
#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"

namespace hlm::server {

/// Limits in metres and radians of the handle: those of the world by the device's scales.
struct HandleLimits {
  double max_speed = 5;   ///< m/s. A quick hand reaches 2; less ends its session.
  double max_rate = 100;  ///< rad/s. A wrist reaches 30.
  double workspace = 2;   ///< Distance from where the session began, m.

  /// The fault that the handle at X_WD with V_WD is, in a session that it began at X_WStart.
  /// scale, rotation_scale: as the device rates them.
  Fault exceeded(const Pose& X_WStart, const Pose& X_WD, const Twist& V_WD, double scale,
                 double rotation_scale = 1) const noexcept {
    const bool fast = V_WD.head<3>().norm() > max_speed * scale ||
                      V_WD.tail<3>().norm() > max_rate * rotation_scale;
    if (fast) return Fault::kHandleSpeed;
    const bool far = (X_WD.p - X_WStart.p).norm() > workspace * scale;
    return far ? Fault::kWorkspace : Fault::kNone;
  }
};

inline constexpr std::array<NumberOf<HandleLimits>, 3> kHandleNumbers{{
    {{0.1, 1000, "m/s"},
     "handle speed limit",
     &HandleLimits::max_speed,
     "A handle that is faster is a fault"},
    {{1, 1e4, "rad/s"},
     "handle rate limit",
     &HandleLimits::max_rate,
     "A handle that turns faster is a fault"},
    {{0.01, 1000, "m"},
     "workspace",
     &HandleLimits::workspace,
     "A handle farther from where the session began is a fault"},
}};

}  // namespace hlm::server
