#include "haptic_server/local_model/local_model.h"

#include <algorithm>

#include "haptic_server/local_model/free_motion.h"
#include "haptic_server/local_model/stiffness_limit.h"

namespace hlm::server {
namespace {

/// How fast the stiffness factor may change, 1/s. Faster is felt as a jump where contacts come or
/// go under load; slower leaves the stiffness above its limit for longer.
constexpr double kStiffnessScaleRate = 10;

ProxyContactState proxy_state(const LocalContacts& contacts) noexcept {
  ProxyContactState state = ProxyContactState::kFreeMotion;
  for (const LocalContact& contact : contacts) {
    if (contact.state == ContactState::kColliding) return ProxyContactState::kColliding;
    if (contact.state != ContactState::kImpending) state = ProxyContactState::kResting;
  }
  return state;
}

}  // namespace

LocalModel::LocalModel(const ToolDescription& tool, const Configuration& q,
                       const LocalModelParameters& parameters, double dt) noexcept
    : parameters_(parameters),
      dt_(dt),
      proxy_(tool),
      ve_tool_(tool),
      v_(Velocity::Zero(tool.dof())) {
  proxy_.set_configuration(q);
  ve_tool_.set_configuration(q);
}

void LocalModel::adopt(const ReportedContacts& reported, const Configuration& q_VE,
                       double age) noexcept {
  ve_tool_.set_configuration(q_VE);
  const UpdatePolicy policy{.rule = parameters_.update_rule,
                            .release_step = parameters_.release_step / parameters_.stiffness,
                            .recovery_steps = parameters_.recovery_steps};
  const LocalContacts& existing = present();
  current_ = 1 - current_;
  adopt_update(existing, reported, ve_tool_, proxy_, age, policy, present());
}

ContactWrench LocalModel::step(const HandInput& hand) noexcept {
  advance_contacts(present(), proxy_, dt_);

  const LinkMotion links(proxy_);
  const MassMatrix mass = proxy_.mass_matrix();
  const Eigen::LLT<MassMatrix> D(mass);
  const Jacobian J_h = proxy_.hand_jacobian();
  const HandMap H = hand_map(proxy_, D, J_h);
  limit_stiffness(D, links, H);
  evaluate(links);

  ContactWrench felt;
  if (state_ == ProxyContactState::kColliding) {
    const GeneralisedForce impulse = collide(D, links);
    v_ += D.solve(impulse);
    felt.impulse = H.lazyProduct(impulse);
  }

  // E v⁺ = r + Δt Σ J_iᵀ f_i: Eq. 7 with the hand's wrench at the end of the step.
  const ContactLaw law = contact_law(parameters_.contact_step);
  const bool implicit = law.step == ContactStep::kImplicit;
  MassMatrix E = mass;
  GeneralisedForce r = mass * v_ + dt_ * (J_h.transpose().lazyProduct(hand.F) - proxy_.gravity());
  if (implicit) {
    const Twist V = J_h.lazyProduct(v_);
    const Vector6 impedance = hand.damping + dt_ * hand.stiffness;
    E += dt_ * (J_h.transpose() * impedance.asDiagonal() * J_h);
    r += dt_ * J_h.transpose().lazyProduct(Vector6(hand.damping.cwiseProduct(V)));
  }
  GeneralisedForce tau = GeneralisedForce::Zero(proxy_.dof());
  if (state_ != ProxyContactState::kFreeMotion) {
    const Velocity v = implicit ? solve_contact_step(present(), links, E, r, law) : v_;
    tau = apply_contact_forces(present(), links, link_twists(links, v), law);
  }
  v_ = E.llt().solve(r + dt_ * tau);
  move_freely(proxy_, v_, dt_);
  felt.F = H.lazyProduct(tau);
  return felt;
}

ContactWrench LocalModel::follow(const Configuration& q, const Velocity& v) noexcept {
  proxy_.set_configuration(q);
  v_ = v;
  advance_contacts(present(), proxy_, dt_);

  const LinkMotion links(proxy_);
  const Eigen::LLT<MassMatrix> D(proxy_.mass_matrix());
  const HandMap H = hand_map(proxy_, D, proxy_.hand_jacobian());
  limit_stiffness(D, links, H);
  evaluate(links);

  ContactWrench felt;
  const GeneralisedForce tau = apply_contact_forces(present(), links, link_twists(links, v_),
                                                    contact_law(ContactStep::kExplicit)) -
                               proxy_.gravity();
  felt.F = H.lazyProduct(tau);
  return felt;
}

/// J_cᵀ p over all colliding and penetrating contacts. Constraints count as static: contacts are
/// chosen by their relative velocity, but v_constr adds no momentum.
GeneralisedForce LocalModel::collide(const Eigen::LLT<MassMatrix>& D,
                                     const LinkMotion& links) const noexcept {
  ContactNormals normals(proxy_.dof(), static_cast<Eigen::Index>(contacts().size()));
  Eigen::Index count = 0;
  for (const LocalContact& contact : contacts()) {
    if (contact.state != ContactState::kColliding && contact.state != ContactState::kPenetrating) {
      continue;
    }
    Vector6 row;
    row << contact.n_W, links.arm(contact).cross(contact.n_W);
    normals.col(count++) = links.jacobian(contact.link()).transpose().lazyProduct(row);
  }
  normals.conservativeResize(Eigen::NoChange, count);
  return collision_impulse(parameters_.collision_rule, D, normals, v_, parameters_.restitution);
}

void LocalModel::limit_stiffness(const Eigen::LLT<MassMatrix>& D, const LinkMotion& links,
                                 const HandMap& H) noexcept {
  if (!limits_stiffness(parameters_)) return;
  const double target =
      server::stiffness_scale(unit_stiffness(contacts(), links), D, H, parameters_);
  const double change = kStiffnessScaleRate * dt_;
  stiffness_scale_ = std::clamp(target, stiffness_scale_ - change, stiffness_scale_ + change);
}

void LocalModel::evaluate(const LinkMotion& links) noexcept {
  evaluate_contacts(present(), links, link_twists(links, v_));
  state_ = proxy_state(contacts());
}

ContactLaw LocalModel::contact_law(ContactStep step) const noexcept {
  return {.stiffness = stiffness_scale_ * parameters_.stiffness,
          .damping = parameters_.damping,
          .static_friction = parameters_.static_friction,
          .kinetic_friction = parameters_.kinetic_friction,
          .dt = dt_,
          .step = step};
}

}  // namespace hlm::server
