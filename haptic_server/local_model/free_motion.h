// The motion of a tool on which no force acts (docs/method.md 1).
#pragma once

#include "hlm/common/tool_model.h"

namespace hlm::server {

/// Moves the tool, and its velocity v, by dt seconds under D(q) q̈ + c(q, q̇) = 0.
///
/// A rigid tool keeps its momentum exactly: its centre of mass goes straight on, its orientation
/// follows from its angular momentum. A linkage takes a step of the classical Runge-Kutta method,
/// after which its velocity is scaled to the kinetic energy of before. Both are of fourth order in
/// dt. Where a velocity is so large that the result is no number, nothing moves.
void move_freely(ToolModel& tool, Velocity& v, double dt) noexcept;

}  // namespace hlm::server
