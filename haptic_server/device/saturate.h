// A wrench cut to what someone can exert.
#pragma once

#include "hlm/common/spatial.h"

namespace hlm::server {

/// F with force and torque each shortened, in their own direction, to at most max_force (N) and
/// max_torque (N·m), both >= 0.
inline Wrench saturated(const Wrench& F, double max_force, double max_torque) noexcept {
  const double force = F.head<3>().norm();
  const double torque = F.tail<3>().norm();
  Wrench result = F;
  if (force > max_force) result.head<3>() *= max_force / force;
  if (torque > max_torque) result.tail<3>() *= max_torque / torque;
  return result;
}

}  // namespace hlm::server
