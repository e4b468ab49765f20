#include "tests/experiments/trial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include "haptic_server/local_model/contact_update.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

using server::LocalContacts;
using server::LocalModel;
using server::TickRecord;

/// Springs that the hand feels, as far as an update changes them: resultant and energy.
struct Springs {
  Vector3 force = Vector3::Zero();
  double energy = 0;
};
Springs springs(const LocalContacts& contacts, const ToolModel& proxy, double stiffness) {
  Springs sum;
  for (const server::LocalContact& contact : contacts) {
    const double depth = std::max(0.0, -server::separation(contact, proxy));
    sum.force += stiffness * depth * contact.n_W;
    sum.energy += stiffness * depth * depth / 2;
  }
  return sum;
}

/// Keeps the local model of the tick before, and compares.
class UpdateObserver {
 public:
  explicit UpdateObserver(double stiffness) : stiffness_(stiffness) {}

  void see(const LocalModel& model, const TickRecord& record, std::vector<UpdateEffect>& effects) {
    if (record.adopted > 0 && proxy_) {
      const Springs before = springs(contacts_, *proxy_, stiffness_);
      const Springs after = springs(model.contacts(), *proxy_, stiffness_);
      effects.push_back({record.time, (after.force - before.force).norm(),
                         after.energy - before.energy, arrivals(model.contacts())});
    }
    contacts_ = model.contacts();
    proxy_ = model.proxy();
  }

 private:
  int arrivals(const LocalContacts& contacts) const {
    int count = 0;
    for (const server::LocalContact& contact : contacts) {
      count += std::none_of(contacts_.begin(), contacts_.end(),
                            [&](const auto& old) { return old.key == contact.key; });
    }
    return count;
  }

  double stiffness_;
  LocalContacts contacts_;
  std::optional<ToolModel> proxy_;
};

/// In [low, high), the same on every platform.
double drawn(std::mt19937_64& engine, double low, double high) {
  return low + (high - low) * 0x1.0p-53 * static_cast<double>(engine() >> 11);
}

bool couples_engine(const Method& method) { return !server::uses_contacts(method.controller); }

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
  return {.max_force = kFar, .max_torque = kFar, .fade_time = 0.02};
}

test::VirtualSessionOptions session_options(const Trial& trial, const server::HandScript& hand) {
  const auto& [task, method, conditions, seed] = trial;
  test::VirtualSessionOptions options;
  options.world = task.world;
  options.tool = task.tool;
  options.device = task.device;
  options.hand = hand;
  options.link = conditions.link;
  options.rate_low = conditions.ve_low;
  options.rate_high = conditions.ve_high;
  options.seed = seed;
  options.frame = {.epsilon = method.epsilon,
                   .largest_epsilon = method.largest_epsilon,
                   .delay = conditions.ve_delay};
  if (conditions.waits) options.acknowledgement_timeout = 0.5;

  server::ServoOptions& servo = options.servo;
  servo.rate = conditions.servo_rate;
  servo.controller = method.controller;
  servo.limits = no_further_limits();
  servo.silence_time = 2;  // Losses must not end a trial.
  servo.local_model.update_rule = method.rule;
  servo.local_model.stiffness = task.stiffness;
  servo.local_model.damping = task.damping;
  servo.local_model.static_friction = servo.local_model.kinetic_friction = task.friction;

  // The tool is carried along with the proxy, so that reported depths are those of the proxy. An
  // engine that is coupled has a tool of its own, drawn by the spring that the hand feels.
  options.follow.mode = ve::FollowMode::kKinematic;
  if (couples_engine(method)) {
    constexpr double kArm = 0.04;  // m: turns K_c into an angular stiffness, half the peg's length.
    servo.gains = {.stiffness = task.stiffness,
                   .damping = task.damping,
                   .angular_stiffness = task.stiffness * kArm * kArm,
                   .angular_damping = task.damping * kArm * kArm};
    const double mass = 1;  // kg, of the tool.
    const double w = std::sqrt(task.stiffness / mass);
    options.follow = {.mode = ve::FollowMode::kImplicit,
                      .frequency = w / (2 * std::numbers::pi),
                      .damping_ratio = task.damping / (2 * mass * w),
                      .max_force = 1e6};
  }
  return options;
}

}  // namespace

Trace run(const Trial& trial) {
  std::mt19937_64 engine(trial.seed);
  const double round_trip = 2 * (trial.conditions.link.delay + trial.conditions.link.jitter);
  // On a tick, so that trials under other conditions see the same hand.
  const double drawn_start = drawn(engine, 0.3, 0.5) + 2 * round_trip;
  const double rate = trial.conditions.servo_rate;
  const double start = std::round(drawn_start * rate) / rate;
  const double reach = trial.task.off_centre;
  const Vector3 offset(drawn(engine, -reach, reach), drawn(engine, -reach, reach), 0);
  const server::HandScript hand = hand_script(off_centre(trial.task.hand, offset), start);

  Trace trace;
  trace.controller = trial.method.controller;
  UpdateObserver observer(trial.task.stiffness);
  test::VirtualSession* running = nullptr;
  double acts_from = -1;  // s, on the network's clock.
  const double dt = 1 / rate;
  test::VirtualSession session(session_options(trial, hand), [&](const TickRecord& record) {
    if (record.step == 1) acts_from = record.time - dt + start;
    if (acts_from < 0 || record.time < acts_from - dt / 2) return;
    trace.ticks.push_back(record);
    trace.ticks.back().time -= acts_from;
    if (running->servo().local_model()) {
      observer.see(*running->servo().local_model(), trace.ticks.back(), trace.updates);
    }
  });
  running = &session;
  session.run(start + round_trip + 0.2);
  if (acts_from < 0) throw std::logic_error("the session did not begin");
  while (trace.ticks.empty() || trace.ticks.back().time < trial.task.duration) session.run(0.1);
  return trace;
}

ve::WorldDescription with_body_at(ve::WorldDescription world, const std::string& name,
                                  const Pose& X_WB) {
  for (const ve::ModelDescription& model : world.models) {
    if (model.name == name) {
      world.bodies[static_cast<std::size_t>(model.first_body)].X_WB = X_WB;
      return world;
    }
  }
  throw std::logic_error("the world has no model " + name);
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
