#include "hlm/haptic_server/local_model/local_model.h"

#include <algorithm>
#include <array>

#include "hlm/haptic_server/local_model/collision.h"
#include "hlm/haptic_server/local_model/free_motion.h"

namespace hlm::server {
namespace {

/// Time constant of healing, s. Near the loop through the environment, what heals swings with what
/// is reported; much longer is no healing.
constexpr double kHealingTime = 0.2;

ProxyContactState proxy_state(const std::array<const LocalContacts*, 2>& sets) noexcept {
  ProxyContactState state = ProxyContactState::kFreeMotion;
  for (const LocalContacts* contacts : sets) {
    for (const LocalContact& contact : *contacts) {
      if (contact.now.state == ContactState::kColliding) return ProxyContactState::kColliding;
      if (contact.now.state != ContactState::kImpending) state = ProxyContactState::kResting;
    }
  }
  return state;
}

bool is_closed(const LocalContact& contact) noexcept {
  return contact.now.state == ContactState::kColliding ||
         contact.now.state == ContactState::kPenetrating;
}

using ClosedContacts = StaticVector<const LocalContact*, kMaxCollisions>;

/// Adds those that are closed, as far as there is room. Returns how many there are then.
std::size_t collect(const LocalContacts& contacts, ClosedContacts& closed) noexcept {
  for (const LocalContact& contact : contacts) {
    if (is_closed(contact) && closed.size() < closed.capacity()) closed.push_back(&contact);
  }
  return closed.size();
}

/// Jᵀ of a unit impulse along n, over all unknowns.
Unknowns along_normal(const LocalContact& contact, const FrameMotions& frames) noexcept {
  Vector6 row;
  row << contact.now.n_W, (contact.now.p_W - frames.reference_W()).cross(contact.now.n_W);
  Unknowns direction = Unknowns::Zero(frames.unknowns());
  const auto add = [&](const FrameMotion& frame, double sign) {
    if (frame.J.cols() == 0) return;
    direction.segment(frame.first, frame.J.cols()) += sign * frame.J.transpose().lazyProduct(row);
  };
  add(frames[contact.frame_a], 1);
  add(frames[contact.frame_b], -1);
  return direction;
}

/// Adds to E v⁺ = r that the hand's wrench changes with the velocity at the end of the step.
void resist(const HandInput& hand, const Jacobian& J_h, const Velocity& v, double dt, MassMatrix& E,
            GeneralisedForce& r) noexcept {
  const Twist V = J_h.lazyProduct(v);
  const Vector6 impedance = hand.damping + dt * hand.stiffness;
  E += dt * (J_h.transpose() * impedance.asDiagonal() * J_h);
  r += dt * J_h.transpose().lazyProduct(Vector6(hand.damping.cwiseProduct(V)));
}

}  // namespace

LocalModel::LocalModel(const ToolDescription& tool, const Configuration& q,
                       const LocalModelParameters& parameters, double dt) noexcept
    : parameters_(parameters),
      dt_(dt),
      proxy_(tool),
      ve_tool_(tool),
      v_(Velocity::Zero(tool.dof())),
      limits_(tool, q),
      loads_(tool),
      search_(dt) {
  proxy_.set_configuration(q);
  ve_tool_.set_configuration(q);
}

ContactWrench LocalModel::step(const HandInput& hand, bool floats) noexcept {
  look_around();
  const MassMatrix mass = proxy_.mass_matrix();
  const Eigen::LLT<MassMatrix> D(mass);
  const Jacobian J_h = proxy_.hand_jacobian();
  const HandMap H = hand_map(proxy_, D, J_h);
  begin_step(bodies_.local(), bodies_.mechanisms(), dt_);
  FrameMotions frames(proxy_, &v_, bodies(), dt_);
  evaluate(frames);
  stiffness_limit_.limit(proxy_, contacts(), frames, D, H, parameters_, dt_);

  ContactWrench felt;
  if (state_ == ProxyContactState::kColliding) {
    felt.impulse = H.lazyProduct(collide(frames, D));
    frames = FrameMotions(proxy_, &v_, bodies(), dt_);
  }

  // E x = r + Δt Σ J_iᵀ f_i: Eq. 7 with the hand's and external wrenches at the end of the step,
  // and the bodies.
  const ContactLaw law = contact_law(parameters_.contact_step);
  const bool implicit = law.step == ContactStep::kImplicit;
  MassMatrix E = mass;
  GeneralisedForce weight = proxy_.gravity();
  if (floats) weight.setZero();
  GeneralisedForce r = mass * v_ + dt_ * (J_h.transpose().lazyProduct(hand.F) - weight);
  if (implicit) resist(hand, J_h, v_, dt_, E, r);
  loads_.external.begin_step(proxy_, v_, dt_, E, r);
  loads_.drives.begin_step(proxy_, hand.opening, dt_);
  Unknowns x;
  if (!implicit) {
    loads_.drives.revise(v_);
    loads_.drives.add_to(E, r);
  }
  const GeneralisedForce tau =
      implicit ? apply_implicitly(frames, law, E, r, x) : apply_explicitly(frames, law, x);
  v_ = E.llt().solve(r + dt_ * tau);
  loads_.latest = loads_.external.end_step(proxy_, v_, dt_) - weight;
  loads_.latest += loads_.drives.end_step(v_, loads_.of_contacts);
  move_freely(proxy_, v_, dt_);
  felt.weight = H.lazyProduct(load());
  felt.F = H.lazyProduct(tau) + felt.weight;
  end_step(frames, x);
  return felt;
}

ContactWrench LocalModel::follow(const Configuration& q, const Velocity& v) noexcept {
  proxy_.set_configuration(q);
  v_ = v;
  search_.set_looked(false);
  look_around();
  const Eigen::LLT<MassMatrix> D(proxy_.mass_matrix());
  const HandMap H = hand_map(proxy_, D, proxy_.hand_jacobian());
  begin_step(bodies_.local(), bodies_.mechanisms(), dt_);
  const FrameMotions frames(proxy_, &v_, bodies(), dt_);
  evaluate(frames);
  stiffness_limit_.limit(proxy_, contacts(), frames, D, H, parameters_, dt_);

  Unknowns x;
  ContactLaw law = contact_law(ContactStep::kExplicit);
  law.rendered = tank_.rendered();
  const GeneralisedForce tau = apply_explicitly(frames, law, x);
  GeneralisedForce r = GeneralisedForce::Zero(proxy_.dof());
  MassMatrix E = MassMatrix::Zero(proxy_.dof(), proxy_.dof());  // Of no use: v is given.
  loads_.external.begin_step(proxy_, v_, dt_, E, r);
  loads_.latest = loads_.external.end_step(proxy_, v_, dt_) - proxy_.gravity();
  ContactWrench felt;
  felt.weight = H.lazyProduct(load());
  felt.F = H.lazyProduct(tau) + felt.weight;
  end_step(frames, x);
  return felt;
}

/// The contacts with their forces at the end of the step, for which x solves it: returns what they
/// do to the tool. E and r are without the joints' drives before, and with them afterwards.
GeneralisedForce LocalModel::apply_implicitly(const FrameMotions& frames, const ContactLaw& law,
                                              MassMatrix& E, GeneralisedForce& r,
                                              Unknowns& x) noexcept {
  const int d = proxy_.dof();
  StepSystem system = unit_system(frames);
  const MassMatrix undriven_E = E;
  const GeneralisedForce undriven_r = r;
  const auto drive = [&] {
    E = undriven_E;
    r = undriven_r;
    loads_.drives.add_to(E, r);
    system.E.topLeftCorner(d, d) = E;
    system.r.head(d) = r;
  };
  drive();
  const std::array<ContactGroup, 3> groups{
      {{contacts_.contacts(), law},
       {limits_.contacts(), law},
       {contacts_.supports(), support_law(dt_, kSupportFriction)}}};
  x = solve_contact_step(groups, frames, system);
  if (x.allFinite() && loads_.drives.revise(x.head(d))) {
    drive();
    x = solve_contact_step(groups, frames, system);
  }
  correct_step(groups, frames, system, x);
  if (!x.allFinite()) x.setZero();  // Levers and speeds beyond numbers: what is deep pushes.
  loads_.of_contacts = apply_contact_forces(groups[0], frames, x).head(d);
  const GeneralisedForce tau =
      loads_.of_contacts + apply_contact_forces(groups[1], frames, x).head(d);
  apply_contact_forces(groups[2], frames, x);
  return tau;
}

/// The tool's contacts with their forces at the start of the step: returns what they do to the
/// tool, and x with what that does to the bodies.
GeneralisedForce LocalModel::apply_explicitly(const FrameMotions& frames, const ContactLaw& law,
                                              Unknowns& x) noexcept {
  const int d = proxy_.dof();
  x.setZero(frames.unknowns());
  x.head(d) = v_;
  Unknowns tau = apply_contact_forces({contacts_.contacts(), law}, frames, x);
  loads_.of_contacts = tau.head(d);
  tau += apply_contact_forces({limits_.contacts(), law}, frames, x);
  const ContactGroup supports{contacts_.supports(), support_law(dt_, kSupportFriction)};
  StepSystem system = unit_system(frames);
  system.r.tail(x.size() - d) = dt_ * tau.tail(x.size() - d);
  x.tail(x.size() - d) = solve_contact_step({&supports, 1}, frames, system).tail(x.size() - d);
  apply_contact_forces(supports, frames, x);
  return tau.head(d);
}

/// Where a body leans on another, when it is pushed counts; of others it moves positions alone,
/// away from where they are here.
void LocalModel::report_impulses() noexcept {
  BodyImpulses::Slots evenly;
  const FrameIndex first = frame_of_body(proxy_, 0);
  for (const LocalBody& body : bodies()) {
    const ContactSide side{SideKind::kMovableBody, body.id};
    const auto leans = [&](const LocalContact& contact) {
      return contact.latest.loaded && contact.frame_a >= first && contact.frame_b >= first &&
             (contact.a == side || contact.b == side);
    };
    if (!body.inertia && std::ranges::any_of(supports(), leans)) evenly.push_back(body.slot);
  }
  impulses_.report(evenly);
}

void LocalModel::miss(std::uint64_t steps, bool holds) noexcept {
  if (steps == 0) return;
  for (const LocalContact& contact : contacts()) {
    if (holds && contact.latest.loaded) add_impulse(contact, dt_ * contact.latest.f_W);
  }
  impulses_.end_step();
  impulses_.repeat(steps - 1);
}

/// Impulses are kept, bodies and constraints go on.
void LocalModel::end_step(const FrameMotions& frames, const Unknowns& x) noexcept {
  double taken = 0;
  double stored = 0;
  for (const LocalContact& contact : contacts()) {
    const double depth = std::min(contact.now.s, 0.0);
    taken += contact.latest.taken;
    stored += stiffness_limit_.factor() * parameters_.stiffness * depth * depth / 2;
    if (contact.latest.loaded) add_impulse(contact, dt_ * contact.latest.f_W);
  }
  tank_.fill(taken);
  tank_.bound_debt(stored);
  impulses_.end_step();
  advance_bodies(bodies_.local(), bodies_.mechanisms(), proxy_, frames, x, dt_);
  const FramePoses poses = poses_of(proxy_, bodies());
  advance_constraints(contacts_.supports(), dt_);
  advance_contacts(contacts_.contacts(), poses, policy(), dt_, tank_.energy());
  bodies_.advance(dt_);
  search_.set_looked(false);
}

/// Keeps an impulse (N·s, world, at the contact's point) on side a, of which a body on side b
/// receives the opposite.
void LocalModel::add_impulse(const LocalContact& contact, const Vector3& P_W) noexcept {
  const auto add = [&](FrameIndex frame, const Vector3& impulse) {
    const auto first = frame_of_body(proxy_, 0);
    if (frame < first) return;
    const LocalBody& body = bodies()[static_cast<std::size_t>(frame - first)];
    if (body.inertia) return;
    Vector6 P;
    P << impulse, (contact.now.p_W - body.X_WB.p).cross(impulse);
    impulses_.add(body.slot, P);
  };
  add(contact.frame_a, P_W);
  add(contact.frame_b, -P_W);
}

/// Resolves the collisions of all closed contacts. Returns the generalised impulse on the tool.
GeneralisedForce LocalModel::collide(const FrameMotions& frames,
                                     const Eigen::LLT<MassMatrix>& D) noexcept {
  const int d = proxy_.dof();
  ClosedContacts closed;
  collect(limits(), closed);
  const auto felt = static_cast<Eigen::Index>(collect(contacts(), closed));
  const auto count = static_cast<Eigen::Index>(collect(supports(), closed));

  ImpulseColumns A(frames.unknowns(), count);
  ContactNumbers w(count);
  bool constraints_move = false;
  for (Eigen::Index i = 0; i < count; ++i) {
    const LocalContact& contact = *closed[static_cast<std::size_t>(i)];
    A.col(i) = along_normal(contact, frames);
    A.col(i).head(d) = D.matrixL().solve(A.col(i).head(d));
    const double e = i < felt ? parameters_.restitution : 0;
    const double v_n = contact.now.v_n + contact.now.n_W.dot(contact.constraint.v_WC -
                                                             contact.constraint.v_reported_W);
    w[i] = (1 + e) * v_n;
    constraints_move |= !contact.constraint.v_reported_W.isZero(0);
  }
  const ContactNumbers p = collision_impulses(parameters_.collision_rule, A, w,
                                              constraints_move ? kWedgeAngle : kDistinctAngle);
  const Unknowns u = A.lazyProduct(p);
  // Half of p·(v⁻ + v⁺) is what the impulses do to the kinetic energy.
  const ContactNumbers after = A.transpose().lazyProduct(u);
  for (Eigen::Index i = 0; i < felt; ++i) {
    const double v_n = closed[static_cast<std::size_t>(i)]->now.v_n;
    tank_.fill(std::max(0.0, -p[i] * (v_n + 0.5 * after[i])));
  }
  const GeneralisedForce on_tool = D.matrixL() * GeneralisedForce(u.head(d));
  v_ += D.solve(on_tool);
  bodies_.push(frames, frame_of_body(proxy_, 0), u);
  for (Eigen::Index i = 0; i < felt; ++i) {
    const LocalContact& contact = *closed[static_cast<std::size_t>(i)];
    if (p[i] != 0) add_impulse(contact, p[i] * contact.now.n_W);
  }
  return on_tool;
}

void LocalModel::evaluate(const FrameMotions& frames) noexcept {
  evaluate_contacts(contacts_.contacts(), frames);
  limits_.place(proxy_);
  evaluate_contacts(limits_.contacts(), frames);
  evaluate_contacts(contacts_.supports(), frames);
  state_ = proxy_state({&contacts(), &limits()});
}

UpdatePolicy LocalModel::policy() const noexcept {
  return {.rule = parameters_.update_rule,
          .release_force = parameters_.release_step,
          .stiffness = stiffness_limit_.factor() * parameters_.stiffness,
          .damping = stiffness_limit_.factor() * parameters_.damping,
          .healing_step = parameters_.healing_speed * dt_,
          .healing_share = dt_ / kHealingTime,
          .recovery_steps = parameters_.recovery_steps};
}

ContactLaw LocalModel::contact_law(ContactStep step) const noexcept {
  return {.stiffness = stiffness_limit_.factor() * parameters_.stiffness,
          .damping = stiffness_limit_.factor() * parameters_.damping,
          .static_friction = parameters_.static_friction,
          .kinetic_friction = parameters_.kinetic_friction,
          .dt = dt_,
          .step = step};
}

ContactLaw LocalModel::support_law(double dt, double ahead) const noexcept {
  return {.stiffness = kSupportStiffness,
          .damping = kSupportDamping,
          .static_friction = parameters_.static_friction,
          .kinetic_friction = parameters_.kinetic_friction,
          .ahead = ahead,
          .dt = dt,
          .step = ContactStep::kImplicit};
}

}  // namespace hlm::server
