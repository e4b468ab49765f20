#include "experiments/trial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "hlm/common/uniform.h"
#include "hlm/haptic_server/local_model/contact_update.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

using server::LocalContacts;
using server::LocalModel;
using server::TickRecord;

double spring_force(const server::LocalContact& contact, const server::FramePoses& poses,
                    double stiffness) {
  return stiffness * std::max(0.0, -server::separation(contact, poses));
}

double spring_energy(const LocalContacts& contacts, const server::FramePoses& poses,
                     double stiffness) {
  double sum = 0;
  for (const server::LocalContact& contact : contacts) {
    const double force = spring_force(contact, poses, stiffness);
    sum += force * force / (2 * stiffness);
  }
  return sum;
}

const server::LocalContact* find(const LocalContacts& contacts, std::uint64_t identity) {
  for (const server::LocalContact& contact : contacts) {
    if (contact.identity == identity) return &contact;
  }
  return nullptr;
}

/// What an update made of the contacts, with the proxy where it was.
UpdateEffect compare(const LocalContacts& before, const LocalContacts& after,
                     const server::FramePoses& poses, double stiffness) {
  UpdateEffect effect;
  Vector3 resultant = Vector3::Zero();
  const auto change = [&](double from, double to) {
    effect.rise = std::max(effect.rise, to - from);
    effect.fall = std::max(effect.fall, from - to);
  };
  for (const server::LocalContact& contact : after) {
    const server::LocalContact* old = find(before, contact.identity);
    const double force = spring_force(contact, poses, stiffness);
    resultant += force * contact.now.n_W;
    change(old != nullptr ? spring_force(*old, poses, stiffness) : 0, force);
    if (old == nullptr) effect.arrived_n_W = contact.now.n_W;
  }
  for (const server::LocalContact& contact : before) {
    const double force = spring_force(contact, poses, stiffness);
    resultant -= force * contact.now.n_W;
    if (find(after, contact.identity) == nullptr) change(force, 0);
  }
  effect.force = resultant.norm();
  effect.energy = spring_energy(after, poses, stiffness) - spring_energy(before, poses, stiffness);
  return effect;
}

/// Sees the local model after each tick, and what updates change in it.
class ModelObserver {
 public:
  ModelObserver(double stiffness, bool dynamic) : stiffness_(stiffness), dynamic_(dynamic) {}

  void see(const LocalModel& model, const TickRecord& record, Trace& trace) {
    if (record.adopted > 0 && !poses_.empty()) {
      trace.updates.push_back(compare(contacts_, model.contacts(), poses_, stiffness_));
      trace.updates.back().time = record.time;
    }
    const server::FramePoses poses = server::poses_of(model.proxy(), model.bodies());
    const Velocity& v = model.velocity();
    const double kinetic = dynamic_ ? 0.5 * v.dot(model.proxy().mass_matrix() * v) : 0;
    trace.internal_energy.push_back(kinetic + spring_energy(model.contacts(), poses, stiffness_));
    contacts_ = model.contacts();
    poses_ = poses;
  }

 private:
  double stiffness_;
  bool dynamic_;
  LocalContacts contacts_;
  server::FramePoses poses_;  ///< At the end of the tick before; empty before the first.
};

/// Nobody pushes exactly through the centre of mass.
server::HandSegment off_centre(server::HandSegment hand, const Vector3& offset) {
  if (auto* push = std::get_if<server::Push>(&hand.action)) {
    push->constant.tail<3>() += offset.cross(push->constant.head<3>());
    push->amplitude.tail<3>() += offset.cross(push->amplitude.head<3>());
  }
  return hand;
}

server::HandScript hand_script(const server::HandSegment& hand, double start) {
  server::Push rest;
  return {{{start, rest}, hand}, server::AfterLastSegment::kHold};
}

/// Limits are the device's: nothing else shall stand between a method and the hand.
server::LimiterOptions no_further_limits() {
  constexpr double kFar = 1e9;
  return {.max_force = kFar,
          .max_torque = kFar,
          .max_force_rate = kFar,
          .max_torque_rate = kFar,
          .rise_time = 0.02,
          .max_power = kFar,
          .max_turning_power = kFar,
          .max_energy = kFar};
}

test::VirtualSessionOptions session_options(const Trial& trial, const server::HandScript& hand) {
  const auto& [task, method, conditions, seed] = trial;
  test::VirtualSessionOptions options;
  options.world = task.world;
  options.tool = task.tool;
  options.device = task.device;
  options.observer = task.observer;
  options.hand = hand;
  options.link = conditions.link;
  options.rate_low = conditions.ve_low;
  options.rate_high = conditions.ve_high;
  options.seed = seed;
  options.frame.delay = conditions.ve_delay;
  options.frame.report_friction = {};  // That of the task.
  if (conditions.waits) options.acknowledgement_timeout = 0.5;

  server::ServoOptions& servo = options.servo;
  servo.rate = conditions.servo_rate;
  servo.limits = no_further_limits();
  servo.handle = {.max_speed = 1e9, .max_rate = 1e9, .workspace = 1e9};
  servo.silence_time = 2;  // Losses must not end a trial.
  servo.local_model.healing_speed = conditions.healing_speed;
  servo.local_model.max_stiffness_sum =
      std::numeric_limits<double>::infinity();  // Not the paper's.
  servo.local_model.static_friction = servo.local_model.kinetic_friction = task.friction;

  // The tool is carried along with the proxy, so that reported depths are those of the proxy. An
  // engine that is coupled has a tool of its own, drawn by the spring that the hand feels.
  options.follow.mode = ve::FollowMode::kKinematic;
  use(method, task.stiffness, task.damping, options);
  return options;
}

}  // namespace

Trace run(const Trial& trial) {
  std::mt19937_64 engine(trial.seed);
  const double round_trip = 2 * (trial.conditions.link.delay + trial.conditions.link.jitter);
  // On a tick, so that trials under other conditions see the same hand.
  const double drawn_start = uniform(engine, 0.3, 0.5) + 2 * round_trip;
  const double rate = trial.conditions.servo_rate;
  const double start = std::round(drawn_start * rate) / rate;
  const double reach = trial.task.off_centre;
  const Vector3 offset(uniform(engine, -reach, reach), uniform(engine, -reach, reach), 0);
  const server::HandScript hand = hand_script(off_centre(trial.task.hand, offset), start);

  Trace trace;
  trace.controller = trial.method.controller;
  trace.device_delay = trial.task.device.delay;
  ModelObserver observer(trial.task.stiffness, !traits(trial.method.controller).replaces_proxy);
  test::VirtualSession* running = nullptr;
  double acts_from = -1;  // s, on the network's clock.
  const double dt = 1 / rate;
  test::VirtualSession session(session_options(trial, hand), [&](const TickRecord& record) {
    if (record.step == 1 && acts_from < 0) acts_from = record.time - dt + start;
    if (acts_from < 0 || record.time < acts_from - dt / 2) return;
    trace.ticks.push_back(record);
    trace.ticks.back().time -= acts_from;
    const bool goes_on =
        renders_force(record.server) && record.session == trace.ticks.front().session;
    trace.broken = trace.broken || !goes_on;
    if (goes_on) {
      observer.see(*running->servo().local_model(), trace.ticks.back(), trace);
    } else {
      trace.internal_energy.push_back(0);
    }
  });
  running = &session;
  session.run(start + round_trip + 0.2);
  if (acts_from < 0) throw std::logic_error("the session did not begin");
  while (trace.ticks.empty() || trace.ticks.back().time < trial.task.duration) session.run(0.1);
  return trace;
}

server::HandSegment push(const Vector3& constant) {
  server::Push push;
  push.constant.head<3>() = constant;
  return {1.0, push};
}

server::HandSegment shake(const Vector3& amplitude, double frequency) {
  server::Push push;
  push.amplitude.head<3>() = amplitude;
  push.frequency = frequency;
  return {1.0, push};
}

}  // namespace hlm::experiments
