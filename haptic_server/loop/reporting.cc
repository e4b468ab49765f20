#include "hlm/haptic_server/loop/reporting.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "hlm/protocol/text.h"

namespace hlm::server {
namespace {

/// How long a total is repeated after the environment has passed the step in which it changed,
/// steps: what was lost on the way comes with one of these.
constexpr std::uint64_t kRepeatedSteps = 1000;

/// Every number of a message is finite: 0 where the device has no rating.
double rating(double value) noexcept { return std::isfinite(value) ? value : 0; }

protocol::DeviceReport report_of(Device& device) noexcept {
  const DeviceRatings& ratings = device.ratings();
  protocol::DeviceReport report;
  report.name = protocol::to_text(device.name());
  report.max_force = rating(ratings.max_force);
  report.max_torque = rating(ratings.max_torque);
  report.max_stiffness = rating(ratings.max_stiffness);
  report.max_angular_stiffness = rating(ratings.max_angular_stiffness);
  report.scale = ratings.scale;
  report.buttons = ratings.buttons;
  report.gripper = ratings.gripper;
  report.renders_torque = ratings.max_torque > 0;
  report.measures_hand = device.measures_hand_wrench();
  report.guidable = device.guided_hand() != nullptr;
  report.freedoms = ratings.freedoms;
  report.observes_hand = device.observes_hand_wrench();
  return report;
}

/// Beyond it a number of a state is a mistake, whatever its unit.
constexpr double kLargestNumber = 1e4;

template <class Values>
bool is_plausible(const Values& values) noexcept {
  return values.allFinite() && values.cwiseAbs().maxCoeff() <= kLargestNumber;
}

void replace_implausible(protocol::ProxyState& state) noexcept {
  const auto zero_unless_plausible = [](auto&& values) {
    if (!is_plausible(values)) values.setZero();
  };
  zero_unless_plausible(state.v);
  zero_unless_plausible(state.X_WD.p);
  zero_unless_plausible(state.V_WD);
  zero_unless_plausible(state.F_env);
  zero_unless_plausible(state.F_hand);
  if (!state.X_WD.R.coeffs().allFinite()) state.X_WD.R.setIdentity();
  if (!std::isfinite(state.smallest_separation)) state.smallest_separation = 0;
  if (!std::isfinite(state.gripper)) state.gripper = 0;
  for (double* energy :
       {&state.given, &state.taken, &state.explained, &state.tank, &state.brought}) {
    if (!std::isfinite(*energy)) *energy = 0;
  }
}

}  // namespace

void describe(const Timing& timing, const SafetyStateMachine& machine,
              const protocol::ServerSession& session, std::uint64_t step,
              TickRecord& record) noexcept {
  record.session = session.id();
  record.step = machine.simulates() ? step : 0;
  record.time = timing.begin;
  record.lateness = timing.lateness;
  record.overruns = timing.overruns;
  record.server = machine.state();
  record.fault = machine.fault();
  record.fade = machine.fade();
  record.datagrams = session.statistics().datagrams;
  record.dropped = session.statistics().total_dropped();
  record.dropped_for = session.statistics().dropped;
  record.refusal = session.refusal();
  record.session_open = session.active();
  record.client = session.client();
}

void describe(const LocalModel& model, TickRecord& record) noexcept {
  record.contact_state = model.state();
  record.X_WP = model.proxy().X_WH();
  record.V_WP = model.hand_twist();
  record.X_WT = model.ve_tool().X_WH();
  record.stiffness = model.parameters().stiffness;
  double smallest = std::numeric_limits<double>::infinity();
  for (const LocalContact& contact : model.contacts()) {
    ++(contact.now.s > 0 ? record.predicted_contacts : record.active_contacts);
    smallest = std::min(smallest, contact.now.s);
  }
  record.smallest_separation = model.contacts().empty() ? 0 : smallest;
}

protocol::Welcome welcome(const ServoOptions& options, std::uint64_t fingerprint,
                          double silence_time, Device& device,
                          const protocol::Capabilities& capabilities) noexcept {
  return {.servo_rate = options.rate,
          .fingerprint = fingerprint,
          .tuning = tuning_of(options),
          .silence_time = silence_time,
          .fade_time = options.limits.fade_time,
          .least_update_rate = 1 / options.silence_time.value_or(kDefaultSilenceTimes.most),
          .capabilities = capabilities,
          .device = report_of(device)};
}

protocol::ProxyState proxy_state(const TickRecord& record, std::uint64_t step,
                                 std::uint64_t updates, const LocalModel* model) noexcept {
  protocol::ProxyState state;
  state.step = step;
  state.age = record.age;
  state.server = record.server;
  state.fault = record.fault;
  state.fade = record.fade;
  state.given = record.port.given;
  state.taken = record.port.taken;
  state.explained = record.port.explained;
  state.tank = record.port.tank;
  state.brought = record.brought;
  state.contact_state = record.contact_state;
  state.active_contacts = static_cast<std::uint16_t>(record.active_contacts);
  state.predicted_contacts = static_cast<std::uint16_t>(record.predicted_contacts);
  state.smallest_separation = record.smallest_separation;
  if (model != nullptr) {
    // A proxy that is nowhere is reported where the environment's tool is.
    const Configuration& q = model->proxy().configuration();
    state.q = is_plausible(q) ? q : model->ve_tool().configuration();
    state.v = model->velocity();
    state.grip = model->drives().grip();
  }
  state.X_WD = record.X_WD;
  state.V_WD = record.V_WD;
  state.F_env = record.F_env;
  state.F_command = record.F_command;
  state.F_hand = record.F_hand;
  state.hand_measured = record.hand_measured;
  state.hand_observed = record.hand_observed;
  state.lowered = record.lowered;
  state.limit = record.limit;
  state.buttons = record.buttons;
  state.gripper = record.gripper;
  state.scale = record.scale;
  state.overruns = record.overruns;
  state.updates = updates;
  if (record.fault != Fault::kNone) replace_implausible(state);
  return state;
}

protocol::Impulses impulses_of(const LocalModel& model, double contained) noexcept {
  protocol::Impulses impulses;
  impulses.step = model.impulses().step();
  const auto is_near = [&](std::uint32_t id) {
    const auto& bodies = model.bodies();
    return std::any_of(bodies.begin(), bodies.end(), [id](const auto& b) { return b.id == id; });
  };
  const auto add = [&](bool near) {
    for (const BodyImpulses::Total& total : model.impulses().totals()) {
      if (impulses.bodies.size() == impulses.bodies.capacity()) break;
      if (total.last_step == 0 || is_near(total.body) != near) continue;
      if (near || static_cast<double>(total.last_step + kRepeatedSteps) > contained) {
        impulses.bodies.push_back({total.body, total.P_W});
      }
    }
  };
  add(true);
  add(false);
  return impulses;
}

void tell_held(double now, std::uint64_t step, const LocalModel& model,
               protocol::ServerSession& session) noexcept {
  protocol::HeldBodies message{.step = step, .bodies = {}};
  const auto send = [&] {
    if (!message.bodies.empty()) session.inform(now, message);
    message.bodies.clear();
  };
  for (const HeldState& held : model.held()) {
    if (message.bodies.size() == message.bodies.capacity()) send();
    message.bodies.push_back({.body = held.pose.body,
                              .number = held.number,
                              .X_WB = held.pose.X_WB,
                              .V_W = held.pose.V_W});
  }
  send();
}

}  // namespace hlm::server
