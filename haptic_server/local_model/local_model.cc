#include "haptic_server/local_model/local_model.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "haptic_server/local_model/body_friction.h"
#include "haptic_server/local_model/collision.h"
#include "haptic_server/local_model/free_motion.h"
#include "haptic_server/local_model/pair_axes.h"
#include "haptic_server/local_model/stiffness_limit.h"

namespace hlm::server {
namespace {

/// How fast the stiffness factor may change, 1/s. Faster is felt as a jump where contacts come or
/// go under load; slower leaves the stiffness above its limit for longer.
constexpr double kStiffnessScaleRate = 10;
/// Stiffness and damping of contacts without the tool, N/m and N·s/m. Nobody feels them, so they
/// may be as good as rigid: softer, a jammed body yields under the tool; much stiffer, rounding of
/// their separation is felt.
constexpr double kSupportStiffness = 1e6;
constexpr double kSupportDamping = 1e3;
/// On the friction of contacts without the tool. With 1, a body that slides in the environment
/// sticks here now and then: it is lost and hit again.
constexpr double kSupportFriction = 0.9;
/// Time constant of healing, s. Near the loop through the environment, what heals swings with what
/// is reported; much longer is no healing.
constexpr double kHealingTime = 0.2;
/// Most energy that is kept to heal with, J: that of 5 N over 20 mm. More would let an old blow pay
/// for a wall that comes much later.
constexpr double kTankSize = 0.1;
/// Longest time in which a correction of a body's velocity enters, s: a slow environment's frame.
constexpr double kLongestCorrection = 0.1;
/// Speeds at which nothing that a hand touches moves, m/s and rad/s: a body beyond them is the
/// product of numbers without sense.
constexpr double kLargestBodySpeed = 100;
constexpr double kLargestBodySpin = 1000;
/// Most steps in which an update with one body is brought to the present; longer loops take longer
/// steps, and so do more bodies: the time of a tick bounds both.
constexpr std::uint64_t kReplaySteps = 40;

ProxyContactState proxy_state(const std::array<const LocalContacts*, 2>& sets) noexcept {
  ProxyContactState state = ProxyContactState::kFreeMotion;
  for (const LocalContacts* contacts : sets) {
    for (const LocalContact& contact : *contacts) {
      if (contact.state == ContactState::kColliding) return ProxyContactState::kColliding;
      if (contact.state != ContactState::kImpending) state = ProxyContactState::kResting;
    }
  }
  return state;
}

bool is_closed(const LocalContact& contact) noexcept {
  return contact.state == ContactState::kColliding || contact.state == ContactState::kPenetrating;
}

std::uint64_t whole_steps(double steps) noexcept {
  return static_cast<std::uint64_t>(std::max(0.0, steps));
}

bool is_plausible(const LocalBody& body) noexcept {
  return body.X_WB.p.allFinite() && body.X_WB.R.coeffs().allFinite() &&
         body.V_W.head<3>().norm() <= kLargestBodySpeed &&
         body.V_W.tail<3>().norm() <= kLargestBodySpin;
}

/// Makes a body one that nothing moves.
void hold(LocalBody& body, const Pose& X_WB) noexcept {
  body.X_WB = X_WB;
  body.V_W.setZero();
  body.A_W.setZero();
  body.B.resize(6, 0);
}

/// Jᵀ of a unit impulse along n, over all unknowns.
Unknowns along_normal(const LocalContact& contact, const FrameMotions& frames) noexcept {
  Vector6 row;
  row << contact.n_W, (contact.p_W - frames.reference_W()).cross(contact.n_W);
  Unknowns direction = Unknowns::Zero(frames.unknowns());
  const auto add = [&](const FrameMotion& frame, double sign) {
    if (frame.J.cols() == 0) return;
    direction.segment(frame.first, frame.J.cols()) += sign * frame.J.transpose().lazyProduct(row);
  };
  add(frames[contact.frame_a], 1);
  add(frames[contact.frame_b], -1);
  return direction;
}

/// A step in which nothing acts but contacts: unit mass in all unknowns.
StepSystem unit_system(const FrameMotions& frames) noexcept {
  StepSystem system;
  system.E.setIdentity(frames.unknowns(), frames.unknowns());
  system.r.setZero(frames.unknowns());
  return system;
}

void advance_bodies(LocalBodies& bodies, const FrameMotions& frames, std::size_t first_frame,
                    const Unknowns& x, double dt) noexcept {
  for (std::size_t slot = 0; slot < bodies.size(); ++slot) {
    LocalBody& body = bodies[slot];
    const FrameMotion& frame = frames[static_cast<FrameIndex>(first_frame + slot)];
    const Twist change = body.B.lazyProduct(x.segment(frame.first, frame.J.cols()));
    body.advance(body.free_twist(dt) + change, dt);
  }
}

}  // namespace

LocalModel::LocalModel(const ToolDescription& tool, const Configuration& q,
                       const LocalModelParameters& parameters, double dt) noexcept
    : parameters_(parameters),
      dt_(dt),
      proxy_(tool),
      ve_tool_(tool),
      v_(Velocity::Zero(tool.dof())),
      limits_(tool, q) {
  proxy_.set_configuration(q);
  ve_tool_.set_configuration(q);
}

void LocalModel::adopt(const ModelUpdate& update) noexcept {
  ve_tool_.set_configuration(update.q_VE);
  // An environment that does not say which step its bodies are at has them as old as its contacts.
  impulses_.end_silence();
  const auto now = static_cast<double>(impulses_.world_step());
  const double state_step = update.impulse_step > 0
                                ? std::min(impulses_.world_step(update.impulse_step), now)
                                : now - update.age / dt_;
  LocalBodies bodies;
  for (const MovableBody& reported : update.bodies) {
    if (bodies.size() == bodies.capacity()) break;
    const auto has_id = [&](const LocalBody& body) { return body.id == reported.id; };
    const std::optional<std::size_t> slot = impulses_.enrol(reported.id);
    if (!slot || std::any_of(bodies.begin(), bodies.end(), has_id)) continue;
    LocalBody& body = bodies.emplace_back(reported);
    body.slot = *slot;
    body.pending_W = impulses_.total(*slot) - reported.P_W -
                     impulses_.between(*slot, whole_steps(state_step), impulses_.world_step());
  }
  UpdateFrames frames{.tool = proxy_,
                      .bodies = bodies,
                      .reported = poses_of(ve_tool_, bodies),
                      .before = poses_of(proxy_, bodies_)};
  const LocalContacts& existing = contacts();
  const LocalContacts& existing_supports = supports();
  current_ = 1 - current_;
  adopt_supports(existing_supports, update.contacts, frames, kSupportStiffness, present_supports());
  scale_friction(bodies, bodies_, frame_of_body(proxy_, 0), present_supports());
  const LocalBodies reported = bodies;
  replay(bodies, present_supports(), state_step);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (!is_plausible(bodies[i])) hold(bodies[i], reported[i].X_WB);
  }
  frames.set_now(poses_of(proxy_, bodies));
  const double unspent =
      adopt_update(existing, update.contacts, frames, update.age, policy(), contacts_[current_]);
  if (std::isfinite(unspent)) tank_ = std::clamp(tank_ + unspent, -kTankSize, kTankSize);
  correct_gradually(bodies, update.period);
  const FrictionReport report{.contacts = update.contacts,
                              .kinetic_friction = parameters_.kinetic_friction,
                              .ahead = kSupportFriction,
                              .elapsed = (state_step - adopted_step_) * dt_,
                              .late = (now - state_step) * dt_};
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    learn_friction(bodies[i], reported[i].X_WB, reported[i].V_W, report);
  }
  adopted_step_ = state_step;
  bodies_ = bodies;
}

void LocalModel::release_bodies() noexcept {
  const LocalBodies none;
  UpdateFrames frames{.tool = proxy_,
                      .bodies = none,
                      .reported = poses_of(proxy_, none),
                      .before = poses_of(proxy_, bodies_)};
  frames.set_now(frames.reported);
  server::release_bodies(contacts_[current_], frames, policy());
  present_supports().clear();
  bodies_.clear();
  impulses_.begin_silence();
}

/// Brings bodies and their own contacts from the world step that an update is about to the present,
/// under the impulses that came since.
void LocalModel::replay(LocalBodies& bodies, LocalContacts& supports, double from) const noexcept {
  if (bodies.empty()) return;
  const std::uint64_t now = impulses_.world_step();
  const double start =
      std::clamp(from, static_cast<double>(impulses_.oldest()), static_cast<double>(now));
  for (LocalBody& body : bodies) {
    body.V_W += body.B * body.B.transpose().lazyProduct(body.pending_W);
  }
  std::uint64_t done = whole_steps(start);
  double into_step = start - static_cast<double>(done);
  const std::uint64_t most = std::max<std::uint64_t>(8, 2 * kReplaySteps / (1 + bodies.size()));
  const std::uint64_t stride = (now - done + most - 1) / most;
  while (done < now) {
    const std::uint64_t next = std::min(done + stride, now);
    const double dt = (static_cast<double>(next - done) - into_step) * dt_;
    into_step = 0;
    for (LocalBody& body : bodies) {
      const Vector6 P = impulses_.between(body.slot, done, next);
      body.V_W += body.B * body.B.transpose().lazyProduct(P);
    }
    const FrameMotions frames(proxy_, nullptr, bodies, dt);
    evaluate_contacts(supports, frames);
    const ContactGroup group{supports, support_law(dt, 1)};
    const Unknowns x = solve_contact_step({&group, 1}, frames, unit_system(frames));
    apply_contact_forces(group, frames, x);
    advance_bodies(bodies, frames, frame_of_body(proxy_, 0), x, dt);
    advance_constraints(supports, dt);
    done = next;
  }
}

/// Bodies go on at the velocity that they have; what the update has found it to be wrong by enters
/// over one frame, or slower where that would make the damping force jump.
void LocalModel::correct_gradually(LocalBodies& updated, double period) const noexcept {
  for (LocalBody& body : updated) {
    for (const LocalBody& known : bodies_) {
      if (known.id != body.id || !is_plausible(known)) continue;
      body.correction = body.V_W - known.V_W;
      const double frame = std::clamp(period, dt_, kLongestCorrection) / dt_;
      const double gentle =
          damping_on(body) * body.correction.head<3>().norm() / parameters_.release_step;
      body.correction_steps =
          static_cast<int>(std::max(frame, std::min(gentle, kLongestCorrection / dt_)));
      body.V_W = known.V_W;
    }
  }
}

/// Of the tool's loaded contacts with a body, N·s/m.
double LocalModel::damping_on(const LocalBody& body) const noexcept {
  const ContactSide side{SideKind::kMovableBody, body.id};
  const auto loaded = std::count_if(contacts().begin(), contacts().end(), [&](const auto& contact) {
    return contact.loaded && contact.b == side;
  });
  return static_cast<double>(loaded) * parameters_.damping;
}

ContactWrench LocalModel::step(const HandInput& hand) noexcept {
  const MassMatrix mass = proxy_.mass_matrix();
  const Eigen::LLT<MassMatrix> D(mass);
  const Jacobian J_h = proxy_.hand_jacobian();
  const HandMap H = hand_map(proxy_, D, J_h);
  FrameMotions frames(proxy_, &v_, bodies_, dt_);
  evaluate(frames);
  limit_stiffness(D, H);

  ContactWrench felt;
  if (state_ == ProxyContactState::kColliding) {
    felt.impulse = H.lazyProduct(collide(frames, D));
    frames = FrameMotions(proxy_, &v_, bodies_, dt_);
  }

  // E x = r + Δt Σ J_iᵀ f_i: Eq. 7 with the hand's wrench at the end of the step, and the bodies.
  const ContactLaw law = contact_law(parameters_.contact_step);
  const bool implicit = law.step == ContactStep::kImplicit;
  const int d = proxy_.dof();
  MassMatrix E = mass;
  const GeneralisedForce weight = proxy_.gravity();
  GeneralisedForce r = mass * v_ + dt_ * (J_h.transpose().lazyProduct(hand.F) - weight);
  if (implicit) {
    const Twist V = J_h.lazyProduct(v_);
    const Vector6 impedance = hand.damping + dt_ * hand.stiffness;
    E += dt_ * (J_h.transpose() * impedance.asDiagonal() * J_h);
    r += dt_ * J_h.transpose().lazyProduct(Vector6(hand.damping.cwiseProduct(V)));
  }
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
    tau = apply_contact_forces(groups[0], frames, x).head(d);
    tau += apply_contact_forces(groups[1], frames, x).head(d);
    apply_contact_forces(groups[2], frames, x);
  } else {
    tau = apply_explicitly(frames, law, x);
  }
  v_ = E.llt().solve(r + dt_ * tau);
  move_freely(proxy_, v_, dt_);
  felt.weight = -H.lazyProduct(weight);
  felt.F = H.lazyProduct(tau) + felt.weight;
  end_step(frames, x);
  return felt;
}

ContactWrench LocalModel::follow(const Configuration& q, const Velocity& v) noexcept {
  proxy_.set_configuration(q);
  v_ = v;
  const Eigen::LLT<MassMatrix> D(proxy_.mass_matrix());
  const HandMap H = hand_map(proxy_, D, proxy_.hand_jacobian());
  const FrameMotions frames(proxy_, &v_, bodies_, dt_);
  evaluate(frames);
  limit_stiffness(D, H);

  Unknowns x;
  const GeneralisedForce tau = apply_explicitly(frames, contact_law(ContactStep::kExplicit), x);
  ContactWrench felt;
  felt.weight = -H.lazyProduct(proxy_.gravity());
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

/// Impulses are kept, bodies and constraints go on.
void LocalModel::end_step(const FrameMotions& frames, const Unknowns& x) noexcept {
  for (const LocalContact& contact : contacts()) {
    if (contact.loaded) add_impulse(contact, dt_ * contact.f_W);
  }
  impulses_.end_step();
  advance_bodies(bodies_, frames, frame_of_body(proxy_, 0), x, dt_);
  const FramePoses poses = poses_of(proxy_, bodies_);
  advance_constraints(present_supports(), dt_);
  advance_constraints(contacts_[current_].waiting, dt_);
  fill_tank();
  advance_contacts(present(), poses, policy(), parameters_.damping, dt_, tank_);
}

/// What the dampers of the tool's contacts take out in a step is there to heal with.
void LocalModel::fill_tank() noexcept {
  for (const LocalContact& contact : contacts()) {
    tank_ += contact.damper_power * dt_;
  }
  tank_ = std::min(tank_, kTankSize);
}

/// Keeps an impulse (N·s, world, at the contact's point) on side a, of which a body on side b
/// receives the opposite.
void LocalModel::add_impulse(const LocalContact& contact, const Vector3& P_W) noexcept {
  const auto add = [&](FrameIndex frame, const Vector3& impulse) {
    const auto first = frame_of_body(proxy_, 0);
    if (frame < first) return;
    const LocalBody& body = bodies_[static_cast<std::size_t>(frame - first)];
    Vector6 P;
    P << impulse, (contact.p_W - body.X_WB.p).cross(impulse);
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
    const double v_n = contact.v_n + contact.n_W.dot(contact.v_WC - contact.v_reported_W);
    w[i] = (1 + e) * v_n;
    constraints_move |= !contact.v_reported_W.isZero(0);
  }
  const ContactNumbers p = collision_impulses(parameters_.collision_rule, A, w,
                                              constraints_move ? kWedgeAngle : kDistinctAngle);

  const Unknowns u = A.lazyProduct(p);
  // Half of p·(v⁻ + v⁺) is what the impulses do to the kinetic energy.
  const ContactNumbers after = A.transpose().lazyProduct(u);
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(felt); ++i) {
    const double v_n = closed[static_cast<std::size_t>(i)]->v_n;
    tank_ += std::max(0.0, -p[i] * (v_n + 0.5 * after[i]));
  }
  const GeneralisedForce on_tool = D.matrixL() * GeneralisedForce(u.head(d));
  v_ += D.solve(on_tool);
  const std::size_t first = frame_of_body(proxy_, 0);
  for (std::size_t slot = 0; slot < bodies_.size(); ++slot) {
    const FrameMotion& frame = frames[static_cast<FrameIndex>(first + slot)];
    bodies_[slot].V_W += bodies_[slot].B.lazyProduct(u.segment(frame.first, frame.J.cols()));
  }
  for (std::size_t i = 0; i < felt; ++i) {
    if (p[static_cast<Eigen::Index>(i)] == 0) continue;
    add_impulse(*closed[i], p[static_cast<Eigen::Index>(i)] * closed[i]->n_W);
  }
  return on_tool;
}

void LocalModel::limit_stiffness(const Eigen::LLT<MassMatrix>& D, const HandMap& H) noexcept {
  const double target =
      limits_stiffness(parameters_)
          ? server::stiffness_scale(unit_stiffness(contacts(), proxy_), D, H, parameters_)
          : 1;
  const double change = kStiffnessScaleRate * dt_;
  stiffness_scale_ = std::clamp(target, stiffness_scale_ - change, stiffness_scale_ + change);
}

void LocalModel::evaluate(const FrameMotions& frames) noexcept {
  evaluate_contacts(present(), frames);
  choose_axes(contacts_[current_], frames, policy(), dt_);
  limits_.place(proxy_);
  evaluate_contacts(limits_.contacts(), frames);
  evaluate_contacts(present_supports(), frames);
  state_ = proxy_state({&contacts(), &limits()});
}

UpdatePolicy LocalModel::policy() const noexcept {
  return {.rule = parameters_.update_rule,
          .release_force = parameters_.release_step,
          .stiffness = stiffness_scale_ * parameters_.stiffness,
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

ContactLaw LocalModel::support_law(double dt, double friction_scale) const noexcept {
  return {.stiffness = kSupportStiffness,
          .damping = kSupportDamping,
          .static_friction = parameters_.static_friction,
          .kinetic_friction = parameters_.kinetic_friction,
          .friction_scale = friction_scale,
          .dt = dt,
          .step = ContactStep::kImplicit};
}

}  // namespace hlm::server
