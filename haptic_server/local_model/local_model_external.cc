// External wrenches in the step of the local model.
#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {

/// With ve_tool_ at the update's configuration. Of a link without a wrench, too: what the first one
/// changes by tells how it depends on the motion.
void LocalModel::adopt_external(const ModelUpdate& update) noexcept {
  if (update.v_VE == nullptr) return;
  for (std::size_t i = 0; i < external_.size(); ++i) {
    Wrench F_W = Wrench::Zero();
    for (const ExternalWrench& each : update.external) {
      if (each.link == i) F_W += each.F_W;
    }
    const auto link = static_cast<int>(i);
    const Pose& X_WL = ve_tool_.X_WL(link);
    const Jacobian J = ve_tool_.jacobian(link, X_WL.p);
    external_[i].report(
        {.time = update.time, .X_WL = X_WL, .V_W = J.lazyProduct(*update.v_VE), .F_W = F_W});
  }
}

/// Adds what acts on the proxy to E v⁺ = r.
void LocalModel::begin_external(MassMatrix& E, GeneralisedForce& r) noexcept {
  for (std::size_t i = 0; i < external_.size(); ++i) {
    if (!external_[i].acts()) continue;
    const auto link = static_cast<int>(i);
    const Pose& X_WL = proxy_.X_WL(link);
    const Jacobian J = proxy_.jacobian(link, X_WL.p);
    const Twist V = J.lazyProduct(v_);
    const WrenchField::Step step = external_[i].begin_step(X_WL, V, dt_, most_external_);
    const Matrix6 impedance = step.inertia + dt_ * step.damping + dt_ * dt_ * step.stiffness;
    E += J.transpose() * impedance * J;
    r += J.transpose().lazyProduct(Wrench(dt_ * step.F_W + step.inertia * V));
  }
}

/// What acted on the proxy, which has its velocity of the step's end and is still where it began.
GeneralisedForce LocalModel::end_external() noexcept {
  GeneralisedForce tau = GeneralisedForce::Zero(proxy_.dof());
  for (std::size_t i = 0; i < external_.size(); ++i) {
    if (!external_[i].acts()) continue;
    const auto link = static_cast<int>(i);
    const Jacobian J = proxy_.jacobian(link, proxy_.X_WL(link).p);
    tau += J.transpose().lazyProduct(external_[i].end_step(J.lazyProduct(v_), dt_));
  }
  return tau;
}

}  // namespace hlm::server
