#include "haptic_server/loop/servo.h"

#include <algorithm>
#include <cmath>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// Ages beyond this are taken for a clock gone wrong, s: constraints are not advanced further.
constexpr double kLargestAge = 1.0;

const ReportedContacts kNoContacts;

bool is_finite(const DeviceState& device) noexcept {
  return device.X_WD.p.allFinite() && device.X_WD.R.coeffs().allFinite() &&
         device.V_WD.allFinite() && (!device.F_hand || device.F_hand->allFinite());
}

protocol::Tuning tuning_of(const ServoOptions& options) noexcept {
  const LocalModelParameters& local = options.local_model;
  const ControllerGains& gains = options.gains;
  return {.update_rule = local.update_rule,
          .controller = options.controller,
          .stiffness = local.stiffness,
          .damping = local.damping,
          .friction = local.kinetic_friction,
          .restitution = local.restitution,
          .coupling_stiffness = gains.stiffness,
          .coupling_damping = gains.damping,
          .coupling_angular_stiffness = gains.angular_stiffness,
          .coupling_angular_damping = gains.angular_damping};
}

/// Options as a control changes them.
ServoOptions tuned(ServoOptions options, const protocol::Tuning& tuning) noexcept {
  LocalModelParameters& local = options.local_model;
  local.update_rule = tuning.update_rule;
  local.stiffness = tuning.stiffness;
  local.damping = tuning.damping;
  // One coefficient in the tuning; where it is left alone, so is the difference between the two.
  if (tuning.friction != local.kinetic_friction) {
    local.static_friction = local.kinetic_friction = tuning.friction;
  }
  local.restitution = tuning.restitution;
  options.controller = tuning.controller;
  options.gains = {.stiffness = tuning.coupling_stiffness,
                   .damping = tuning.coupling_damping,
                   .angular_stiffness = tuning.coupling_angular_stiffness,
                   .angular_damping = tuning.coupling_angular_damping};
  return options;
}

/// Options outside what a control may set could not be told to a client, nor set back by one.
std::optional<std::string> find_error(const protocol::Tuning& tuning) {
  for (const protocol::TuningRange& range : protocol::kTuningRanges) {
    const double value = tuning.*range.number;
    if (value >= range.least && value <= range.most) continue;
    std::string name = range.name;
    std::replace(name.begin(), name.end(), '_', ' ');
    return fmt::format("{} {} must be {} to {}{}{}", name, value, range.least, range.most,
                       *range.unit ? " " : "", range.unit);
  }
  return std::nullopt;
}

/// A client refuses numbers that are not finite, and would never learn of the fault.
void replace_non_finite(protocol::ProxyState& state) noexcept {
  const auto zero_unless_finite = [](auto& values) {
    if (!values.allFinite()) values.setZero();
  };
  zero_unless_finite(state.v);
  zero_unless_finite(state.X_WD.p);
  zero_unless_finite(state.V_WD);
  zero_unless_finite(state.F_env);
  zero_unless_finite(state.F_hand);
  if (!state.X_WD.R.coeffs().allFinite()) state.X_WD.R.setIdentity();
  if (!std::isfinite(state.smallest_separation)) state.smallest_separation = 0;
}

}  // namespace

std::optional<std::string> find_error(const ServoOptions& options) {
  if (auto error = find_error(tuning_of(options))) return error;
  if (auto error = find_error(options.local_model)) return error;
  if (auto error = find_error(options.gains)) return error;
  const auto check = [](const char* name, double value,
                        const char* unit) -> std::optional<std::string> {
    if (value > 0 && std::isfinite(value)) return std::nullopt;
    return fmt::format("{} {} must be finite and > 0 {}", name, value, unit);
  };
  if (auto error = check("force limit", options.limits.max_force, "N")) return error;
  if (auto error = check("torque limit", options.limits.max_torque, "N·m")) return error;
  if (auto error = check("fade time", options.limits.fade_time, "s")) return error;
  if (auto error = check("silence time", options.silence_time, "s")) return error;
  return check("largest gap", options.max_gap, "s");
}

Servo::Servo(const ServoOptions& options, std::uint64_t configuration,
             protocol::ServerSession& session, Device& device) noexcept
    : options_(options),
      dt_(1 / options.rate),
      configuration_(configuration),
      session_(session),
      device_(device),
      controller_(options.controller, options.gains),
      spreader_(device.ratings(), dt_),
      limiter_(options.limits, device.ratings(), dt_),
      machine_(options.silence_time, dt_) {}

const TickRecord& Servo::tick(const Timing& timing) noexcept {
  const protocol::ServerSession::Inbox inbox = session_.poll(timing.begin);
  record_ = TickRecord{};
  advance_session(inbox, timing);
  if (inbox.control != nullptr && machine_.simulates()) apply(*inbox.control);
  if (inbox.update != nullptr && machine_.simulates()) adopt(*inbox.update);
  if (inbox.hello != nullptr) begin_session(*inbox.hello, timing.begin);
  if (machine_.simulates()) simulate();
  describe(timing);
  if (inbox.update != nullptr) acknowledge(timing.begin);
  if (machine_.state() == ServerState::kRunning) {
    telemetry_.tick(timing.begin, record_, timing.previous_execution, limiter_.limited_by(),
                    session_);
  }
  return record_;
}

void Servo::shut_down(double now) noexcept {
  limiter_.cut();
  device_.write(Wrench::Zero());
  device_.disable();
  session_.close(now, protocol::GoodbyeReason::kShutdown);
  machine_ = ServerStateMachine(options_.silence_time, dt_);
  local_model_.reset();
}

void Servo::begin_session(const protocol::Hello& hello, double now) noexcept {
  if (replaces_proxy(options_.controller) && hello.tool.links.size() != 1) {
    session_.reject(now, protocol::RejectReason::kTool,
                    "this controller needs a tool of one link; use another one");
    return;
  }
  local_model_.emplace(hello.tool, hello.q, options_.local_model, dt_);
  device_.align(local_model_->proxy().X_WH());
  engine_.begin(local_model_->proxy().X_WH());
  device_.enable();
  spreader_.clear();
  limiter_.cut();
  machine_.begin();
  step_ = 0;
  updates_ = 0;
  controller_ = Controller(options_.controller, options_.gains);
  telemetry_.begin();
  session_.accept(now, welcome());
}

protocol::Welcome Servo::welcome() const noexcept {
  return {.servo_rate = options_.rate,
          .configuration = configuration_,
          .tuning = tuning_of(options_),
          .guidable = device_.guidable()};
}

void Servo::apply(const protocol::Control& control) noexcept {
  telemetry_.switch_on(control.telemetry);
  device_.guide(control.holds ? std::optional(control.X_WTarget) : std::nullopt);
  const ServoOptions options = control.tuned ? tuned(options_, control.tuning) : options_;
  local_model_->set_parameters(options.local_model);
  // A tool of several links cannot take the device's pose; its controller stays.
  const bool possible = !replaces_proxy(options.controller) || local_model_->proxy().links() == 1;
  controller_ = Controller(possible ? options.controller : controller_.kind(), options.gains);
}

void Servo::advance_session(const protocol::ServerSession::Inbox& inbox,
                            const Timing& timing) noexcept {
  const ServerState before = machine_.state();
  if (inbox.update != nullptr) machine_.update();
  if (inbox.goodbye) machine_.end();
  machine_.tick(limiter_.silent());
  if (static_cast<double>(timing.missed) * dt_ > options_.max_gap && machine_.simulates()) {
    fail(Fault::kOverrun);
  }
  limiter_.allow(machine_.wants_force());
  if (machine_.state() == ServerState::kIdle && before != ServerState::kIdle) {
    device_.disable();
    local_model_.reset();
  }
}

/// The age of the contacts is counted in steps, not read from clocks, so that a replay finds the
/// same: what the environment says it took, and half the round trip of its echo.
void Servo::adopt(const protocol::ContactUpdate& update) noexcept {
  double travel = 0;
  if (update.echo_step > 0 && update.echo_step <= step_) {
    const double round_trip = static_cast<double>(step_ - update.echo_step) * dt_;
    travel = std::max(0.0, round_trip - update.echo_hold) / 2;
  }
  record_.age = std::min(update.compute_time + travel, kLargestAge);
  local_model_->adopt(uses_contacts(controller_.kind()) ? update.contacts : kNoContacts,
                      update.q_VE, record_.age);
  const ToolModel& tool = local_model_->ve_tool();
  engine_.update(update.echo_step, {tool.X_WH(), tool.hand_jacobian().lazyProduct(update.v_VE)});
  ++updates_;
}

void Servo::simulate() noexcept {
  const std::optional<DeviceState> device = device_.read();
  if (!device) return fail(Fault::kDevice);
  if (!is_finite(*device)) return fail(Fault::kNonFinite);
  record_.X_WD = device->X_WD;
  record_.V_WD = device->V_WD;
  record_.hand_measured = device->F_hand.has_value();
  record_.F_hand = device->F_hand.value_or(Wrench::Zero());

  ++step_;
  const ContactWrench felt = move_proxy(*device);
  if (!local_model_->velocity().allFinite()) return fail(Fault::kNonFinite);
  render(*device, felt);
}

ContactWrench Servo::move_proxy(const DeviceState& device) noexcept {
  const ToolModel& proxy = local_model_->proxy();
  if (replaces_proxy(controller_.kind())) {
    // begin_session() and apply() have made sure of one link.
    const std::optional<ToolAtHand> tool = tool_at_hand(proxy, device.X_WD, device.V_WD);
    return local_model_->follow(tool->q, tool->v);
  }
  return local_model_->step(
      controller_.to_proxy(device, {proxy.X_WH(), local_model_->hand_twist()}));
}

void Servo::render(const DeviceState& device, const ContactWrench& felt) noexcept {
  const HandMotion proxy{local_model_->proxy().X_WH(), local_model_->hand_twist()};
  const bool as_seen = controller_.kind() == ControllerKind::kEngineForce;
  Wrench u =
      controller_.to_device(as_seen ? engine_.device() : device, proxy, engine_.tool(), felt.F);
  Wrench impulse = Wrench::Zero();
  if (controller_.kind() != ControllerKind::kVirtualCoupler) {
    impulse = spreader_.render(felt.impulse, u);
  }
  u += impulse;
  record_.F_env = felt.F + impulse;
  record_.F_command = limiter_.limit(u);
  if (limiter_.met_non_finite()) return fail(Fault::kNonFinite);
  if (!device_.write(record_.F_command)) fail(Fault::kDevice);
}

void Servo::fail(Fault fault) noexcept {
  machine_.fail(fault);
  limiter_.cut();
  record_.F_command.setZero();
  device_.write(Wrench::Zero());
  device_.disable();
}

void Servo::describe(const Timing& timing) noexcept {
  record_.session = session_.id();
  record_.step = machine_.simulates() ? step_ : 0;
  record_.time = timing.begin;
  record_.lateness = timing.lateness;
  record_.overruns = timing.overruns;
  record_.server = machine_.state();
  record_.fault = machine_.fault();
  record_.datagrams = session_.statistics().datagrams;
  record_.dropped = session_.statistics().total_dropped();
  if (local_model_) describe_proxy();
}

void Servo::describe_proxy() noexcept {
  const ToolModel& ve_tool = local_model_->ve_tool();
  record_.contact_state = local_model_->state();
  record_.X_WP = local_model_->proxy().X_WH();
  record_.V_WP = local_model_->hand_twist();
  record_.X_WT = ve_tool.X_WH();
  double smallest = std::numeric_limits<double>::infinity();
  for (const LocalContact& contact : local_model_->contacts()) {
    ++(contact.s > 0 ? record_.predicted_contacts : record_.active_contacts);
    smallest = std::min(smallest, contact.s);
  }
  record_.smallest_separation = local_model_->contacts().empty() ? 0 : smallest;
}

void Servo::acknowledge(double now) noexcept {
  engine_.acknowledge(step_, record_.X_WD, record_.V_WD);
  record_.adopted = session_.acknowledge(now, proxy_state());
  if (local_model_) {
    telemetry_.contacts(now, step_, *local_model_, limiter_.limited_by(), session_);
  }
}

protocol::ProxyState Servo::proxy_state() const noexcept {
  protocol::ProxyState state;
  state.step = step_;
  state.age = record_.age;
  state.server = machine_.state();
  state.fault = machine_.fault();
  state.contact_state = record_.contact_state;
  state.active_contacts = static_cast<std::uint16_t>(record_.active_contacts);
  state.predicted_contacts = static_cast<std::uint16_t>(record_.predicted_contacts);
  state.smallest_separation = record_.smallest_separation;
  if (local_model_) {
    // Where the proxy is nowhere, the environment's tool stands for it.
    const Configuration& q = local_model_->proxy().configuration();
    state.q = q.allFinite() ? q : local_model_->ve_tool().configuration();
    state.v = local_model_->velocity();
  }
  state.X_WD = record_.X_WD;
  state.V_WD = record_.V_WD;
  state.F_env = record_.F_env;
  state.F_command = record_.F_command;
  state.F_hand = record_.F_hand;
  state.overruns = record_.overruns;
  state.updates = updates_;
  if (machine_.fault() == Fault::kNonFinite) replace_non_finite(state);
  return state;
}

}  // namespace hlm::server
