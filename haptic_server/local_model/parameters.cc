#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::server {

std::optional<std::string> find_error(const LocalModelParameters& p) {
  if (auto error = find_error(p, kLocalModelNumbers)) return error;
  if (p.static_friction < p.kinetic_friction) {
    return "static friction " + shortest_text(p.static_friction) +
           " (--static-friction) must be at least kinetic friction " +
           shortest_text(p.kinetic_friction) + " (--kinetic-friction)";
  }
  return find_error("recovery steps", p.recovery_steps, kRecoverySteps);
}

}  // namespace hlm::server
