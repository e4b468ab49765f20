// One body in a person's hand, for fakes of devices.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace {  // Each fake is one source: two of them in a process share nothing.

using Vec = std::array<double, 3>;

inline Vec operator-(const Vec& a, const Vec& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec operator*(double s, const Vec& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double norm(const Vec& a) { return std::hypot(a[0], a[1], a[2]); }
inline double rounded(double value, double step) { return step * std::round(value / step); }

// Cuts to a magnitude, keeping the direction; a negative limit is none. True if it was cut.
inline bool cut(Vec* value, double limit) {
  const double size = norm(*value);
  if (limit < 0 || size <= limit) return false;
  *value = (limit / size) * *value;
  return true;
}

constexpr double kStep = 1e-4;  // s; of the simulation.

// Position (m, or rad), velocity, and the hand: a spring (N/m) with damping (N·s/m) to an anchor.
struct Body {
  Vec position{}, velocity{}, anchor{};
  double stiffness = 300, damping = 5;

  // One step under the motors' force (N), with a mass (kg) and the device's own friction (N·s/m).
  void step(const Vec& motors, double mass, double friction) {
    for (std::size_t i = 0; i < 3; ++i) {
      const double force = motors[i] + stiffness * (anchor[i] - position[i]);
      // Damping is implicit, so that a stiff brake does not oscillate.
      velocity[i] =
          (velocity[i] + kStep * force / mass) / (1.0 + kStep * (damping + friction) / mass);
      position[i] += kStep * velocity[i];
    }
  }
};

}  // namespace
