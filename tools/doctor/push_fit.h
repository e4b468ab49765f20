// What a small push says of a handle that nobody holds: mass, friction, damping, delay.
#pragma once

#include <optional>
#include <vector>

#include "hlm/tools/doctor/device_bench.h"

namespace hlm::server {

struct PushFit {
  double mass = 0;      ///< Apparent, kg.
  double damping = 0;   ///< N·s/m.
  double friction = 0;  ///< Dry, N.
  double delay = 0;     ///< Delay from a command to its effect in the pose that is read, s.
  /// What of the way the fit does not explain, rms over the largest way.
  double unexplained = 0;
};

/// Fits m x'' = F(t - delay) - b x' - c, x along `direction`, to the ways of a push, up to where
/// the handle rests again. Not velocities, whose filters are not known. Delays up to 60 ms are
/// found, in steps of 0.25 ms. Empty if the handle did not move along `direction`, a unit vector.
std::optional<PushFit> fit_push(const std::vector<HandleSample>& samples, const Vector3& direction);

}  // namespace hlm::server
