#include "hlm/haptic_server/safety/model_energy.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// Velocity of the contact's side b at its point, m/s; of a link of the tool zero: what passes
/// between two links stays in the tool.
Vector3 far_velocity(const LocalContact& contact, const LocalBodies& bodies) noexcept {
  if (contact.frame_b == kWorldFrame) {
    const Vector3& n = contact.now.n_W;
    return contact.constraint.v_constr * n + contact.constraint.v_WC -
           n * n.dot(contact.constraint.v_WC);
  }
  for (const LocalBody& body : bodies) {
    if (contact.b.kind != SideKind::kMovableBody || body.id != contact.b.index) continue;
    return body.V_W.head<3>() + body.V_W.tail<3>().cross(contact.now.p_W - body.X_WB.p);
  }
  return Vector3::Zero();
}

}  // namespace

double stored_energy(const LocalModel& model, double stiffness) noexcept {
  double sum = 0;
  for (const LocalContact& contact : model.contacts()) {
    const double depth = std::min(contact.now.s, 0.0);
    if (depth < 0) sum += depth * depth + contact.friction.z_W.squaredNorm();
  }
  return stiffness * model.stiffness_scale() * sum / 2;
}

double environment_power(const LocalModel& model) noexcept {
  double power = 0;
  for (const LocalContact& contact : model.contacts()) {
    power += contact.latest.f_W.dot(far_velocity(contact, model.bodies()));
  }
  return power;
}

double kinetic_energy(const LocalModel& model) noexcept {
  const Velocity& v = model.velocity();
  const MassMatrix D = model.proxy().mass_matrix();
  return v.dot(D.lazyProduct(v)) / 2;
}

}  // namespace hlm::server
