#include "hlm/haptic_server/local_model/link_wrenches.h"

namespace hlm::server {

void LinkWrenches::adopt(const ModelUpdate& update, const ToolModel& tool) noexcept {
  if (update.v_VE == nullptr) return;
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    Wrench F_W = Wrench::Zero();
    for (const ExternalWrench& each : update.external) {
      if (each.link == i) F_W += each.F_W;
    }
    const auto link = static_cast<int>(i);
    const Pose& X_WL = tool.X_WL(link);
    const Jacobian J = tool.jacobian(link, X_WL.p);
    fields_[i].report(
        {.time = update.time, .X_WL = X_WL, .V_W = J.lazyProduct(*update.v_VE), .F_W = F_W});
  }
}

void LinkWrenches::begin_step(const ToolModel& proxy, const Velocity& v, double dt, MassMatrix& E,
                              GeneralisedForce& r) noexcept {
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (!fields_[i].acts()) continue;
    const auto link = static_cast<int>(i);
    const Pose& X_WL = proxy.X_WL(link);
    const Jacobian J = proxy.jacobian(link, X_WL.p);
    const Twist V = J.lazyProduct(v);
    const WrenchField::Step step = fields_[i].begin_step(X_WL, V, dt, most_);
    const Matrix6 impedance = step.inertia + dt * step.damping + dt * dt * step.stiffness;
    E += J.transpose() * impedance * J;
    r += J.transpose().lazyProduct(Wrench(dt * step.F_W + step.inertia * V));
  }
}

GeneralisedForce LinkWrenches::end_step(const ToolModel& proxy, const Velocity& v,
                                        double dt) noexcept {
  GeneralisedForce tau = GeneralisedForce::Zero(proxy.dof());
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (!fields_[i].acts()) continue;
    const auto link = static_cast<int>(i);
    const Jacobian J = proxy.jacobian(link, proxy.X_WL(link).p);
    tau += J.transpose().lazyProduct(fields_[i].end_step(J.lazyProduct(v), dt));
  }
  return tau;
}

}  // namespace hlm::server
