#include "haptic_server/local_model/parameters.h"

#include <cmath>
#include <sstream>

namespace hlm::server {
namespace {

std::string out_of_range(const char* name, double value, const char* range) {
  std::ostringstream text;
  text << name << ' ' << value << " must be " << range;
  return text.str();
}

}  // namespace

std::optional<std::string> find_error(const LocalModelParameters& p) {
  // Comparisons are written so that NaN fails them.
  if (!(p.stiffness > 0 && std::isfinite(p.stiffness))) {
    return out_of_range("contact stiffness", p.stiffness, "finite and > 0 N/m");
  }
  if (!(p.damping >= 0 && std::isfinite(p.damping))) {
    return out_of_range("contact damping", p.damping, "finite and >= 0 N·s/m");
  }
  if (!(p.restitution >= 0 && p.restitution <= 1)) {
    return out_of_range("restitution", p.restitution, "0 to 1");
  }
  if (!(p.kinetic_friction >= 0 && std::isfinite(p.kinetic_friction))) {
    return out_of_range("kinetic friction", p.kinetic_friction, "finite and >= 0");
  }
  if (!(p.static_friction >= p.kinetic_friction && std::isfinite(p.static_friction))) {
    return out_of_range("static friction", p.static_friction, "finite and >= the kinetic friction");
  }
  if (!(p.release_step > 0 && std::isfinite(p.release_step))) {
    return out_of_range("release step", p.release_step, "finite and > 0 N");
  }
  if (p.recovery_steps < 1) {
    return out_of_range("recovery steps", p.recovery_steps, ">= 1");
  }
  if (!(p.max_hand_stiffness > 0)) {
    return out_of_range("largest stiffness at the hand", p.max_hand_stiffness, "> 0 N/m");
  }
  if (!(p.max_hand_angular_stiffness > 0)) {
    return out_of_range("largest angular stiffness at the hand", p.max_hand_angular_stiffness,
                        "> 0 N·m/rad");
  }
  if (!(p.max_contact_frequency > 0)) {
    return out_of_range("largest contact frequency", p.max_contact_frequency, "> 0 rad/s");
  }
  return std::nullopt;
}

}  // namespace hlm::server
