// The motion of a tool on which no force acts (docs/method.md 1).
#pragma once

#include "common/tool_model.h"

namespace hlm::server {

/// Moves the tool, and its velocity v, by dt seconds under D(q) q̈ + c(q, q̇) = 0.
///
/// A rigid tool keeps its momentum exactly: its centre of mass goes straight on, its orientation
/// follows ω = I⁻¹ L. A linkage is integrated by the classical Runge-Kutta method. Both are of
/// fourth order in dt, and neither gains kinetic energy: what a step would add is taken away again.
void move_freely(ToolModel& tool, Velocity& v, double dt) noexcept;

}  // namespace hlm::server
