// How the local model takes over what the environment reports (docs/method.md 2, 11).
#include <algorithm>
#include <cmath>
#include <optional>

#include "hlm/geometry/work.h"
#include "hlm/haptic_server/local_model/body_friction.h"
#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {
namespace {

/// Longest time in which a correction of a body's velocity enters, s: a slow environment's frame.
constexpr double kLongestCorrection = 0.1;
/// Most steps in which an update with one body is brought to the present; longer loops take longer
/// steps, and so do more bodies: the time of a tick bounds both.
constexpr std::uint64_t kReplaySteps = 40;
/// The same where so much overlaps that contacts are left out.
constexpr std::uint64_t kReplayStepsInCrowd = 4;

/// The first ones are where they were so long ago, s, if they moved as they do; nothing moves them
/// otherwise from there on.
void go_back(LocalBodies& bodies, std::size_t count, double time) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    LocalBody& body = bodies[i];
    body.X_WB.p -= time * body.V_W.head<3>();
    body.X_WB.R = (rotation_from_vector(-time * body.V_W.tail<3>()) * body.X_WB.R).normalized();
    body.A_W.setZero();
    body.B.resize(6, 0);
    body.mechanism = -1;
  }
}

std::uint64_t whole_steps(double steps) noexcept {
  return static_cast<std::uint64_t>(std::max(0.0, steps));
}

/// A contact with a body goes over from the world's frame to the body's, or back.
void reframe(LocalContact& contact, FrameIndex frame_b, const Placement& X_WB) noexcept {
  const bool to_world = frame_b == kWorldFrame;
  const bool changes = to_world != (contact.frame_b == kWorldFrame);
  contact.frame_b = frame_b;
  if (!changes) return;
  LocalContact::Constraint& constraint = contact.constraint;
  if (to_world) {
    constraint.c_B = contact.now.c_W;
    constraint.n_P = contact.now.n_W;
  } else {
    constraint.c_B = X_WB.inverse() * constraint.c_B;
    constraint.n_P = X_WB.R.transpose() * constraint.n_P;
  }
  constraint.plane = PlaneOwner::kB;
  constraint.v_constr = 0;
  constraint.v_WC.setZero();
  constraint.v_reported_W.setZero();
}

}  // namespace

void LocalModel::adopt(const ModelUpdate& update) noexcept {
  ve_tool_.set_configuration(update.q_VE);
  loads_.external.adopt(update, ve_tool_);
  loads_.drives.adopt(update.drives, proxy_);
  impulses_.end_silence();
  const LocalBodies held = bodies_.that_stay(update, search_.scene());
  const auto now = static_cast<double>(impulses_.world_step());
  // An environment that does not say which step its bodies are at has them as old as its contacts.
  const double state_step = update.impulse_step > 0
                                ? std::min(impulses_.world_step(update.impulse_step), now)
                                : now - update.age / dt_;
  const LocalBodies reported = with_reported(held, update, state_step);
  bodies_.adopt_poses(update, reported, search_.scene());
  if (holds() && !moves_ahead() && reported.size() == held.size()) return adopt_held(update, held);
  adopt_ahead(update, held, reported, state_step);
}

/// Nothing is moved ahead of reports: the contacts of what is held go on.
void LocalModel::adopt_held(const ModelUpdate& update, const LocalBodies& held) noexcept {
  set_bodies(held);
  UpdateFrames frames{.tool = proxy_,
                      .bodies = bodies(),
                      .reported = poses_of(ve_tool_, bodies()),
                      .before = poses_of(proxy_, bodies())};
  frames.set_now(frames.before);
  const LocalContacts& existing = contacts();
  const LocalContacts& existing_supports = supports();
  contacts_.renew();
  adopt_supports(existing_supports, update.contacts, frames, kSupportStiffness,
                 contacts_.supports());
  tank_.fill(
      adopt_update(existing, update.contacts, frames, update.age, policy(), contacts_.contacts()));
  keep_scene(existing, contacts_.contacts());
  keep_scene(existing_supports, contacts_.supports());
  for (LocalContacts* contacts : {&contacts_.contacts(), &contacts_.supports()}) {
    std::ranges::sort(*contacts, {}, &LocalContact::identity);
  }
  search_.change().of_bodies = true;
  search_.set_looked(false);
}

/// Bodies are brought from the world step that the update is about to the present.
void LocalModel::adopt_ahead(const ModelUpdate& update, const LocalBodies& held,
                             const LocalBodies& as_reported, double state_step) noexcept {
  const auto now = static_cast<double>(impulses_.world_step());
  LocalBodies bodies = as_reported;
  go_back(bodies, held.size(), (now - replay_start(state_step)) * dt_);
  UpdateFrames frames{.tool = proxy_,
                      .bodies = bodies,
                      .reported = poses_of(ve_tool_, bodies),
                      .before = poses_of(proxy_, bodies_.local())};
  const LocalContacts& existing = contacts();
  const LocalContacts& existing_supports = supports();
  contacts_.renew();
  adopt_supports(existing_supports, update.contacts, frames, kSupportStiffness,
                 contacts_.supports());
  for (const LocalBody& body : held) search_.change().steady.push_back(body.id);
  adopt_supports_of_scene(existing_supports, frames, bodies);
  scale_friction(bodies, bodies_.local(), frame_of_body(proxy_, 0), contacts_.supports());
  const LocalBodies reported = bodies;
  replay(bodies, state_step);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].is_plausible()) bodies[i].hold(reported[i].X_WB);
  }
  std::ranges::copy(held, bodies.begin());
  keep_supports_of_held(existing_supports, frames, contacts_.supports());
  frames.set_now(poses_of(proxy_, bodies));
  tank_.fill(
      adopt_update(existing, update.contacts, frames, update.age, policy(), contacts_.contacts()));
  adopt_contacts_of_scene(existing, frames, bodies);
  correct_gradually(bodies, update.period);
  const FrictionReport report{.contacts = update.contacts,
                              .kinetic_friction = parameters_.kinetic_friction,
                              .ahead = kSupportFriction,
                              .elapsed = (state_step - impulses_.adopt(state_step)) * dt_,
                              .late = (now - state_step) * dt_};
  for (std::size_t i = held.size(); i < bodies.size(); ++i) {
    learn_friction(bodies[i], reported[i].X_WB, reported[i].V_W, report);
  }
  bodies_.set(bodies);
}

/// Other bodies are the local model's from here on.
void LocalModel::set_bodies(const LocalBodies& others) noexcept {
  bodies_.set(others);
  reframe_contacts();
}

/// Contacts go over to the frames of the bodies that there are. What was on one that is gone stays
/// in the world, as the tool's, or goes.
void LocalModel::reframe_contacts() noexcept {
  const FramePoses poses = poses_of(proxy_, bodies());
  for (LocalContacts* contacts : {&contacts_.contacts(), &contacts_.supports()}) {
    erase_if(*contacts, [&](LocalContact& contact) {
      const auto a = frame_of(contact.a, proxy_, bodies());
      const auto b = frame_of(contact.b, proxy_, bodies());
      if (!a || !b || *a == kWorldFrame) return true;
      contact.frame_a = *a;
      reframe(contact, *b, poses[*b]);
      return false;
    });
  }
}

/// Those that are held, then the bodies that the environment moves and the server moves ahead of
/// its reports, as these have them.
LocalBodies LocalModel::with_reported(const LocalBodies& held, const ModelUpdate& update,
                                      double state_step) noexcept {
  LocalBodies bodies = held;
  for (const MovableBody& reported : update.bodies) {
    if (bodies.size() == std::min(bodies.capacity(), held.size() + kMaxBodiesAhead)) break;
    const std::optional<std::size_t> slot = impulses_.enrol(reported.id);
    if (!slot || std::ranges::find(bodies, reported.id, &LocalBody::id) != bodies.end()) continue;
    LocalBody& body = bodies.emplace_back(reported);
    body.slot = *slot;
    const auto rate = std::ranges::find(update.rates, reported.id, &AccelerationRate::body);
    if (rate != update.rates.end()) body.A_rate_W = rate->A_rate_W;
    body.pending_W = impulses_.total(*slot) - reported.P_W -
                     impulses_.between(*slot, whole_steps(state_step), impulses_.world_step());
  }
  return bodies;
}

void LocalModel::release_bodies() noexcept {
  const LocalBodies none;
  UpdateFrames frames{.tool = proxy_,
                      .bodies = none,
                      .reported = poses_of(proxy_, none),
                      .before = poses_of(proxy_, bodies())};
  frames.set_now(frames.reported);
  server::release_bodies(contacts_.contacts(), frames, policy());
  contacts_.supports().clear();
  bodies_.forget_local(search_.scene());
  impulses_.begin_silence();
}

void LocalModel::stop_ahead() noexcept {
  if (!moves_ahead()) return;
  set_bodies(bodies_.stop_ahead());
  impulses_.begin_silence();
}

/// The world step from which what an update says of bodies at that one is repeated.
double LocalModel::replay_start(double from) const noexcept {
  return std::clamp(from, static_cast<double>(impulses_.oldest()),
                    static_cast<double>(impulses_.world_step()));
}

/// Brings bodies and their own contacts from the world step that an update is about to the present,
/// under the impulses that came since. What they meet on the way is looked for in each step.
void LocalModel::replay(LocalBodies& bodies, double from) noexcept {
  if (bodies.empty()) return;
  const std::uint64_t now = impulses_.world_step();
  const double start = replay_start(from);
  for (LocalBody& body : bodies) {
    body.V_W += body.B * body.B.transpose().lazyProduct(body.pending_W);
  }
  std::uint64_t done = whole_steps(start);
  double into_step = start - static_cast<double>(done);
  std::uint64_t most = std::max<std::uint64_t>(8, 2 * kReplaySteps / (1 + bodies.size()));
  if (search_.is_cut()) most = kReplayStepsInCrowd;
  const std::uint64_t stride = (now - done + most - 1) / most;
  const geometry::Work::Allowance allowance(search_.work_in_tick(SceneSearch::kWorkOfBodies));
  while (done < now) {
    const std::uint64_t next = std::min(done + stride, now);
    const double dt = (static_cast<double>(next - done) - into_step) * dt_;
    into_step = 0;
    for (LocalBody& body : bodies) {
      const Vector6 P = impulses_.between(body.slot, done, next);
      body.V_W += body.B * body.B.transpose().lazyProduct(P);
    }
    look_along(bodies, dt);
    LocalContacts& supports = contacts_.supports();
    const FrameMotions frames(proxy_, nullptr, bodies, dt);
    evaluate_contacts(supports, frames);
    const ContactGroup group{supports, support_law(dt, 1)};
    const Unknowns x = solve_contact_step({&group, 1}, frames, unit_system(frames));
    apply_contact_forces(group, frames, x);
    Mechanisms none;
    advance_bodies(bodies, none, proxy_, frames, x, dt);
    advance_constraints(supports, dt);
    done = next;
  }
}

/// Bodies go on at the velocity that they have; what the update has found it to be wrong by enters
/// over one frame, or slower where that would make the damping force jump.
void LocalModel::correct_gradually(LocalBodies& updated, double period) const noexcept {
  for (LocalBody& body : updated) {
    for (const LocalBody& known : this->bodies()) {
      if (known.id != body.id || body.inertia || !known.is_plausible()) continue;
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

/// Damping of the tool's loaded contacts with a body, N·s/m.
double LocalModel::damping_on(const LocalBody& body) const noexcept {
  const ContactSide side{SideKind::kMovableBody, body.id};
  const auto loaded = std::count_if(contacts().begin(), contacts().end(), [&](const auto& contact) {
    return contact.latest.loaded && contact.b == side;
  });
  return static_cast<double>(loaded) * policy().damping;
}

}  // namespace hlm::server
