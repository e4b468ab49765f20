#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

std::optional<std::string> find_error(const LocalModelParameters& p) {
  if (auto error = find_error(p, kLocalModelNumbers)) return error;
  if (p.static_friction < p.kinetic_friction) {
    return find_error("static friction", p.static_friction,
                      Range{p.kinetic_friction, range_of(&Tuning::friction).most});
  }
  return find_error("recovery steps", p.recovery_steps, kRecoverySteps);
}

}  // namespace hlm::server
