#include "hlm/haptic_server/local_model/local_model.h"

#include <algorithm>
#include <cmath>

#include "hlm/haptic_server/local_model/collision.h"
#include "hlm/haptic_server/local_model/free_motion.h"

namespace hlm::server {
namespace {

/// How fast the stiffness factor may change, 1/s. Faster is felt as a jump where contacts come or
/// go under load; slower leaves the stiffness above its limit for longer.
constexpr double kStiffnessScaleRate = 10;
/// Time constant of healing, s. Near the loop through the environment, what heals swings with what
/// is reported; much longer is no healing.
constexpr double kHealingTime = 0.2;
/// Most energy that is kept to heal with, J: that of 5 N over 20 mm. More would let an old blow pay
/// for a wall that comes much later.
constexpr double kTankSize = 0.1;

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

}  // namespace

LocalModel::LocalModel(const ToolDescription& tool, const Configuration& q,
                       const LocalModelParameters& parameters, double dt) noexcept
    : parameters_(parameters),
      dt_(dt),
      proxy_(tool),
      ve_tool_(tool),
      v_(Velocity::Zero(tool.dof())),
      limits_(tool, q),
      external_(tool.links.size(), WrenchField(tool.length)),
      load_(GeneralisedForce::Zero(tool.dof())) {
  proxy_.set_configuration(q);
  ve_tool_.set_configuration(q);
}

ContactWrench LocalModel::step(const HandInput& hand, bool floats) noexcept {
  look_around();
  const MassMatrix mass = proxy_.mass_matrix();
  const Eigen::LLT<MassMatrix> D(mass);
  const Jacobian J_h = proxy_.hand_jacobian();
  const HandMap H = hand_map(proxy_, D, J_h);
  begin_step(bodies_, mechanisms_, dt_);
  FrameMotions frames(proxy_, &v_, bodies_, dt_);
  evaluate(frames);
  limit_stiffness(frames, D, H);

  ContactWrench felt;
  if (state_ == ProxyContactState::kColliding) {
    felt.impulse = H.lazyProduct(collide(frames, D));
    frames = FrameMotions(proxy_, &v_, bodies_, dt_);
  }

  // E x = r + Δt Σ J_iᵀ f_i: Eq. 7 with the hand's and external wrenches at the end of the step,
  // and the bodies.
  const ContactLaw law = contact_law(parameters_.contact_step);
  const bool implicit = law.step == ContactStep::kImplicit;
  const int d = proxy_.dof();
  MassMatrix E = mass;
  GeneralisedForce weight = proxy_.gravity();
  if (floats) weight.setZero();
  GeneralisedForce r = mass * v_ + dt_ * (J_h.transpose().lazyProduct(hand.F) - weight);
  if (implicit) {
    const Twist V = J_h.lazyProduct(v_);
    const Vector6 impedance = hand.damping + dt_ * hand.stiffness;
    E += dt_ * (J_h.transpose() * impedance.asDiagonal() * J_h);
    r += dt_ * J_h.transpose().lazyProduct(Vector6(hand.damping.cwiseProduct(V)));
  }
  begin_external(E, r);
  GeneralisedForce tau;
  Unknowns x;
  if (implicit) {
    StepSystem system = unit_system(frames);
    system.E.topLeftCorner(d, d) = E;
    system.r.head(d) = r;
    const std::array<ContactGroup, 3> groups{
        {{present(), law},
         {limits_.contacts(), law},
         {present_supports(), support_law(dt_, kSupportFriction)}}};
    x = solve_contact_step(groups, frames, system);
    correct_step(groups, frames, system, x);
    if (!x.allFinite()) x.setZero();  // Levers and speeds beyond numbers: what is deep pushes.
    tau = apply_contact_forces(groups[0], frames, x).head(d);
    tau += apply_contact_forces(groups[1], frames, x).head(d);
    apply_contact_forces(groups[2], frames, x);
  } else {
    tau = apply_explicitly(frames, law, x);
  }
  v_ = E.llt().solve(r + dt_ * tau);
  load_ = end_external() - weight;
  move_freely(proxy_, v_, dt_);
  felt.weight = H.lazyProduct(load_);
  felt.F = H.lazyProduct(tau) + felt.weight;
  end_step(frames, x);
  return felt;
}

ContactWrench LocalModel::follow(const Configuration& q, const Velocity& v) noexcept {
  proxy_.set_configuration(q);
  v_ = v;
  looked_ = false;
  look_around();
  const Eigen::LLT<MassMatrix> D(proxy_.mass_matrix());
  const HandMap H = hand_map(proxy_, D, proxy_.hand_jacobian());
  begin_step(bodies_, mechanisms_, dt_);
  const FrameMotions frames(proxy_, &v_, bodies_, dt_);
  evaluate(frames);
  limit_stiffness(frames, D, H);

  Unknowns x;
  ContactLaw law = contact_law(ContactStep::kExplicit);
  law.rendered = rendered_;
  const GeneralisedForce tau = apply_explicitly(frames, law, x);
  GeneralisedForce r = GeneralisedForce::Zero(proxy_.dof());
  MassMatrix E = MassMatrix::Zero(proxy_.dof(), proxy_.dof());  // Of no use: v is given.
  begin_external(E, r);
  load_ = end_external() - proxy_.gravity();
  ContactWrench felt;
  felt.weight = H.lazyProduct(load_);
  felt.F = H.lazyProduct(tau) + felt.weight;
  end_step(frames, x);
  return felt;
}

/// The tool's contacts with their forces at the start of the step: returns what they do to the
/// tool, and x with what that does to the bodies.
GeneralisedForce LocalModel::apply_explicitly(const FrameMotions& frames, const ContactLaw& law,
                                              Unknowns& x) noexcept {
  const int d = proxy_.dof();
  x.setZero(frames.unknowns());
  x.head(d) = v_;
  Unknowns tau = apply_contact_forces({present(), law}, frames, x);
  tau += apply_contact_forces({limits_.contacts(), law}, frames, x);
  const ContactGroup supports{present_supports(), support_law(dt_, kSupportFriction)};
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
  for (const LocalBody& body : bodies_) {
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
    stored += stiffness_scale_ * parameters_.stiffness * depth * depth / 2;
    if (contact.latest.loaded) add_impulse(contact, dt_ * contact.latest.f_W);
  }
  fill_tank(taken);
  // What the springs hold comes back when they are let go: that much debt is not forgotten.
  tank_ = std::max(tank_, -kTankSize - stored);
  impulses_.end_step();
  advance_bodies(bodies_, mechanisms_, proxy_, frames, x, dt_);
  const FramePoses poses = poses_of(proxy_, bodies_);
  advance_constraints(present_supports(), dt_);
  advance_contacts(present(), poses, policy(), dt_, tank_);
  advance_near_bodies();
}

void LocalModel::fill_tank(double energy) noexcept {
  if (std::isfinite(energy)) tank_ = std::min(tank_ + energy, kTankSize);
}

/// Keeps an impulse (N·s, world, at the contact's point) on side a, of which a body on side b
/// receives the opposite.
void LocalModel::add_impulse(const LocalContact& contact, const Vector3& P_W) noexcept {
  const auto add = [&](FrameIndex frame, const Vector3& impulse) {
    const auto first = frame_of_body(proxy_, 0);
    if (frame < first) return;
    const LocalBody& body = bodies_[static_cast<std::size_t>(frame - first)];
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
  StaticVector<const LocalContact*, kMaxCollisions> closed;
  const auto collect = [&closed](const LocalContacts& contacts) {
    for (const LocalContact& contact : contacts) {
      if (is_closed(contact) && closed.size() < closed.capacity()) closed.push_back(&contact);
    }
    return closed.size();
  };
  collect(limits());
  const std::size_t felt = collect(contacts());
  collect(supports());

  const auto count = static_cast<Eigen::Index>(closed.size());
  ImpulseColumns A(frames.unknowns(), count);
  ContactNumbers w(count);
  bool constraints_move = false;
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const LocalContact& contact = *closed[index];
    A.col(i) = along_normal(contact, frames);
    A.col(i).head(d) = D.matrixL().solve(A.col(i).head(d));
    const double e = index < felt ? parameters_.restitution : 0;
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
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(felt); ++i) {
    const double v_n = closed[static_cast<std::size_t>(i)]->now.v_n;
    fill_tank(std::max(0.0, -p[i] * (v_n + 0.5 * after[i])));
  }
  const GeneralisedForce on_tool = D.matrixL() * GeneralisedForce(u.head(d));
  v_ += D.solve(on_tool);
  const std::size_t first = frame_of_body(proxy_, 0);
  for (std::size_t slot = 0; slot < bodies_.size(); ++slot) {
    const FrameMotion& frame = frames[static_cast<FrameIndex>(first + slot)];
    LocalBody& body = bodies_[slot];
    const auto y = u.segment(frame.first, frame.J.cols());
    body.V_W += body.B.lazyProduct(y);
    if (body.mechanism >= 0 && body.member == 0) {
      mechanisms_[static_cast<std::size_t>(body.mechanism)].push(y);
    }
  }
  for (std::size_t i = 0; i < felt; ++i) {
    if (p[static_cast<Eigen::Index>(i)] == 0) continue;
    add_impulse(*closed[i], p[static_cast<Eigen::Index>(i)] * closed[i]->now.n_W);
  }
  return on_tool;
}

void LocalModel::limit_stiffness(const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D,
                                 const HandMap& H) noexcept {
  if (contacts().empty()) return;  // A hand that bounces back finds what it left.
  const double target = stiffness_limit_.scale(proxy_, contacts(), frames, D, H, parameters_);
  const bool touches =
      std::ranges::any_of(contacts(), [](const auto& contact) { return contact.now.s < 0; });
  const double change = touches ? kStiffnessScaleRate * dt_ : 1;
  stiffness_scale_ = std::clamp(target, stiffness_scale_ - change, stiffness_scale_ + change);
}

void LocalModel::evaluate(const FrameMotions& frames) noexcept {
  evaluate_contacts(present(), frames);
  limits_.place(proxy_);
  evaluate_contacts(limits_.contacts(), frames);
  evaluate_contacts(present_supports(), frames);
  state_ = proxy_state({&contacts(), &limits()});
}

UpdatePolicy LocalModel::policy() const noexcept {
  return {.rule = parameters_.update_rule,
          .release_force = parameters_.release_step,
          .stiffness = stiffness_scale_ * parameters_.stiffness,
          .damping = stiffness_scale_ * parameters_.damping,
          .healing_step = parameters_.healing_speed * dt_,
          .healing_share = dt_ / kHealingTime,
          .recovery_steps = parameters_.recovery_steps};
}

ContactLaw LocalModel::contact_law(ContactStep step) const noexcept {
  return {.stiffness = stiffness_scale_ * parameters_.stiffness,
          .damping = stiffness_scale_ * parameters_.damping,
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
