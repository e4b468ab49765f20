#include "hlm/haptic_server/loop/servo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/haptic_server/loop/reporting.h"
#include "hlm/haptic_server/safety/model_energy.h"
#include "hlm/protocol/wire.h"

namespace hlm::server {
namespace {

/// What no hand does, with the world scaled to the handle: speed of the proxy's hand, m/s and
/// rad/s, and its distance from the handle, m. More means that contacts carry it away; less would
/// end a session in which a hand is quick, or pulls hard at a proxy that is held.
constexpr double kLargestHandSpeed = 20;
constexpr double kLargestHandRate = 500;
constexpr double kLargestDistance = 5;

constexpr const char* kUnguarded =
    "the process that guards its motors is gone or stopped: restart the server";
constexpr const char* kSlowScene = "a scene whose contacts could not be found in time";

/// Force on a proxy among shapes, as a share of the largest on the device: where a hand is stronger
/// than that, the coupling would draw the proxy through what it touches. A plane has no other side.
/// The same for external wrenches: beyond, they are not felt, and would throw the proxy.
constexpr double kLargestPush = 2;

const ReportedContacts kNoContacts;

/// Whether the tool's pose can be the device's.
bool can_be_device(const ToolDescription& tool) noexcept {
  return tool.links.size() == 1 && !has_curve(tool.links[0].joint);
}

/// At most `most`, N, and then as a constant force.
void saturate(HandInput& hand, double most) noexcept {
  const double force = hand.F.head<3>().norm();
  if (!(force > most)) return;
  hand.F.head<3>() *= most / force;
  hand.stiffness.head<3>().setZero();
}

}  // namespace

Servo::Servo(const ServoOptions& options, std::uint64_t fingerprint, protocol::ServerSession& link,
             Device& device, SceneSource* scenes) noexcept
    : options_(options),
      fingerprint_(fingerprint),
      link_(link),
      port_(options, device),
      scene_(scenes),
      clocks_(1 / options.rate, options.max_gap),
      machine_(1 / options.rate),
      session_(1 / options.rate),
      controller_(options.controller, options.gains) {}

const TickRecord& Servo::tick(const Timing& timing) noexcept {
  const protocol::ServerSession::Inbox inbox = link_.poll(timing.begin);
  record_ = TickRecord{};
  port_.clear();
  had_session_ = machine_.simulates();
  if (had_session_ && session_.step() > 0) miss(timing);
  advance_session(inbox, timing);
  scene_.load(inbox, link_, model_, clocks_, timing);
  if (inbox.control != nullptr && machine_.simulates()) apply(*inbox.control);
  if (inbox.update != nullptr && machine_.simulates()) adopt(*inbox.update);
  if (inbox.hello != nullptr) begin_session(*inbox.hello, timing.begin);
  if (machine_.simulates()) simulate();
  describe_tick(timing);
  if (inbox.update != nullptr) acknowledge(timing.begin);
  if (renders_force(machine_.state())) {
    telemetry_.tick(timing.begin, record_, timing.previous_execution, port_.limited_by(), link_);
  }
  return record_;
}

/// Periods went by without a tick. The device has held its force, unless its guard has taken the
/// motors off, and the environment's time went on.
void Servo::miss(const Timing& timing) noexcept {
  if (clocks_.stalled(timing)) return;  // A fault.
  session_.advance(timing.missed);
  model_->miss(timing.missed, !port_.halted());
}

void Servo::obey(Intervention intervention) noexcept {
  clocks_.watch(intervention != Intervention::kUnguarded);
  switch (intervention) {
    case Intervention::kStop:
      return fail(Fault::kOperatorStop);
    case Intervention::kClear:
      machine_.release();
      return port_.settle();
    case Intervention::kHalted:
      return port_.halt();
    case Intervention::kNone:
    case Intervention::kUnguarded:
      return;
  }
}

void Servo::shut_down(double now) noexcept {
  port_.cut();
  link_.close(now, protocol::GoodbyeReason::kShutdown);
  machine_ = SafetyStateMachine(clocks_.dt());
  model_.reset();
}

/// What the hand holds goes on without its environment for as long as the scene may; what is moved
/// ahead of reports does not.
double Servo::silence_time(double period) const noexcept {
  const bool alone = model_ && model_->holds() && !model_->moves_ahead();
  return options_.silence_time.value_or(alone ? kOldestPoses : default_silence_time(period));
}

void Servo::reject_in_fault(double now) noexcept {
  std::array<char, protocol::kMaxText> text{};
  const std::string_view what = *cause_ != '\0' ? cause_ : meaning_of(machine_.fault());
  const std::string_view remedy = remedy_of(machine_.fault());
  const bool here = ends_at_device(machine_.fault());
  std::snprintf(text.data(), text.size(), "fault: %.*s; %.*s, %sask for a new session",
                static_cast<int>(what.size()), what.data(), static_cast<int>(remedy.size()),
                remedy.data(), here ? "run haptic_doctor clear at the server, " : "then ");
  link_.reject(now, protocol::RejectReason::kFault, text.data());
}

void Servo::hear(const protocol::ContactUpdate& update) noexcept {
  session_.hear(update);
  const double silence = silence_time(std::max(session_.period(), update.ve_period));
  if (waits_for_scene(update)) return machine_.stand_by(silence);
  machine_.update(silence, session_.oldest(), has_scene() ? kOldestPoses : kOldestContacts);
}

/// No step was taken: the world stands still until its shapes are here.
bool Servo::waits_for_scene(const protocol::ContactUpdate& update) const noexcept {
  const bool is_empty = update.contacts.empty() && update.bodies.empty() && update.poses.empty() &&
                        update.external.empty();
  return machine_.state() == ServerState::kArming && update.ve_period == 0 && update.scene == 0 &&
         is_empty;
}

void Servo::begin_session(const protocol::Hello& hello, double now) noexcept {
  if (!machine_.grants_session(hello.clears_fault)) return reject_in_fault(now);
  if (traits(options_.controller).replaces_proxy && !can_be_device(hello.tool)) {
    link_.reject(now, protocol::RejectReason::kTool,
                 "this controller needs a tool of one link, without a curve; use another one");
    return;
  }
  model_.emplace(hello.tool, hello.q, options_.local_model, clocks_.dt());
  model_->bound_external(kLargestPush * port_.largest_force());
  const ToolModel& proxy = model_->proxy();
  session_.begin(hello, missing_freedoms(proxy, port_.ratings().freedoms));
  scene_.begin(hello.tool);
  clocks_.begin();
  port_.begin(proxy.X_WH());
  engine_.begin(proxy.X_WH());
  controller_ = Controller(options_.controller, options_.gains);
  telemetry_.begin();
  const double silence = silence_time(session_.period());
  machine_.begin(silence);
  link_.accept(now, welcome(options_, fingerprint_, silence, port_.device(),
                            {.movable_bodies = true,
                             .self_contacts = true,
                             .scenes = scene_.offered(),
                             .holds = scene_.offered(),
                             .guides = true}));
}

void Servo::apply(const protocol::Control& control) noexcept {
  telemetry_.switch_on(control.telemetry);
  if (GuidedHand* hand = port_.device().guided_hand()) {
    control.holds ? hand->hold(control.X_WTarget) : hand->release();
  }
  ServoOptions options = control.tuned ? tuned(options_, control.tuning) : options_;
  // Others cannot take the device's pose; their controller stays.
  const bool possible =
      !traits(options.controller).replaces_proxy || can_be_device(model_->proxy().description());
  if (!possible) options.controller = controller_.kind();
  double lowered = 0;
  // What it was started with is bounded already.
  if (control.tuned && !options.keep_stiffness) {
    lowered = 1 - bound_stiffness(options.controller, port_.ratings(), clocks_.dt(), options.gains,
                                  options.local_model);
  }
  session_.lower(lowered);
  model_->set_parameters(options.local_model);
  controller_ = Controller(options.controller, options.gains);
}

void Servo::advance_session(const protocol::ServerSession::Inbox& inbox,
                            const Timing& timing) noexcept {
  const ServerState before = machine_.state();
  if (inbox.heard) machine_.hear();
  if (inbox.refused) machine_.refuse();
  if (inbox.update != nullptr) hear(*inbox.update);
  if (inbox.goodbye) machine_.end();
  machine_.tick(port_.level(), 1 + timing.missed);
  look_at_clocks(timing);
  port_.allow(renders_force(machine_.state()) && clocks_.watched());
  end_what_is_over(before);
}

/// A loop that stood still, or that nothing guards, is a fault.
void Servo::look_at_clocks(const Timing& timing) noexcept {
  if (clocks_.stalled(timing) && machine_.simulates()) {
    const bool by_scene = has_scene() && model_->cut() != geometry::FinderCut{} &&
                          timing.previous_execution >= clocks_.gap(timing);
    by_scene ? fail(Fault::kImplausible, kSlowScene) : fail(Fault::kOverrun);
  }
  if (clocks_.is_unguarded(machine_.simulates(), timing)) {
    fail(Fault::kDevice, kUnguarded);
  }
}

/// A hand without force holds nothing, nor moves anybody the bodies; what lives here waits for an
/// environment that is silent.
void Servo::end_what_is_over(ServerState before) noexcept {
  const ServerState now = machine_.state();
  if (now == before) return;
  if (now == ServerState::kFading) {
    const bool waits = model_ && model_->holds() && machine_.fade() == Fade::kClientSilent;
    waits ? model_->stop_ahead() : model_->release_bodies();
  }
  if (now == ServerState::kOff) {
    port_.disable();
    model_.reset();
  }
}

void Servo::adopt(const protocol::ContactUpdate& update) noexcept {
  record_.age = session_.age_of(update);
  // With shapes the update may be older than contacts may.
  const bool uses_contacts = traits(controller_.kind()).uses_contacts;
  const bool young = !has_scene() || session_.oldest() <= kOldestContacts;
  // A hand without force pushes nothing.
  const bool moves_bodies = uses_contacts && machine_.state() != ServerState::kFading;
  const double stiffness = model_->parameters().stiffness;
  const double stored = stored_energy(*model_, stiffness);
  scene_.use(uses_contacts && update.scene > 0, model_, clocks_);
  if (clocks_.keeps_contacts()) return;  // It does not know yet.
  model_->adopt({.contacts = uses_contacts && young ? update.contacts : kNoContacts,
                 .q_VE = update.q_VE,
                 .age = record_.age,
                 .bodies = moves_bodies ? update.bodies : kNoBodies,
                 .impulse_step = update.impulse_step,
                 .period = update.ve_period,
                 .poses = uses_contacts ? update.poses : kNoPoses,
                 .rates = update.rates,
                 .time = update.ve_time,
                 .v_VE = &update.v_VE,
                 .external = young ? update.external : kNoWrenches,
                 .owners = update.owners,
                 .drives = update.drives,
                 .holds = moves_bodies});
  port_.adopted(stored, stored_energy(*model_, stiffness));
  const ToolModel& tool = model_->ve_tool();
  engine_.update(update.echo_step, {tool.X_WH(), tool.hand_jacobian().lazyProduct(update.v_VE)});
  session_.adopted(update);
}

void Servo::simulate() noexcept {
  had_session_ = true;
  const DeviceState* const device = port_.read(session_.step() == 0, record_);
  if (device == nullptr) return fail(Fault::kDevice, port_.cause());
  if (const Fault fault = port_.observe(*device, record_); fault != Fault::kNone) {
    return fail(fault, fault == Fault::kEnergy ? port_.giver() : "");
  }
  session_.advance(1);
  const ContactWrench felt = move_proxy(*device);
  if (!model_->velocity().allFinite() || !felt.F.allFinite()) return fail(Fault::kNonFinite);
  if (!is_plausible(*device)) return fail(Fault::kImplausible);
  if (const Fault fault = render(*device, felt); fault != Fault::kNone) {
    fail(fault, fault == Fault::kDevice ? port_.cause() : "");
  }
}

ContactWrench Servo::move_proxy(const DeviceState& device) noexcept {
  if (!traits(controller_.kind()).replaces_proxy) return step_proxy(device);
  // begin_session() and apply() have made sure of one link.
  const auto tool = tool_at_hand(model_->proxy(), device.X_WD, device.V_WD);
  const ContactWrench felt = model_->follow(tool->q, tool->v);
  port_.explain(*model_);
  return felt;
}

/// The proxy's step. What hand and weight put into the proxy and it did not keep went on into
/// contacts and coupling; moving constraints push the proxy and, except with a coupler, the device.
/// All in J at the handle.
ContactWrench Servo::step_proxy(const DeviceState& device) noexcept {
  const Pose X_WP = model_->proxy().X_WH();
  HandInput hand = controller_.to_proxy(device, {X_WP, model_->hand_twist()});
  if (has_scene()) saturate(hand, kLargestPush * port_.largest_force());
  hand.opening = device.gripper;
  // What bears it is not known yet.
  const bool floats = machine_.state() == ServerState::kArming;
  const ContactWrench felt = model_->step(hand, floats);
  const Wrench F_hand = controller_.passes_hand_wrench(device) ? *device.F_hand : Wrench::Zero();
  port_.explain(*model_, X_WP, F_hand, device,
                controller_.kind() != ControllerKind::kVirtualCoupler);
  return felt;
}

Fault Servo::render(const DeviceState& device, const ContactWrench& felt) noexcept {
  const HandMotion proxy{model_->proxy().X_WH(), model_->hand_twist()};
  const bool as_seen = controller_.kind() == ControllerKind::kEngineForce;
  const Wrench u =
      controller_.to_device(as_seen ? engine_.device() : device, proxy, engine_.tool(), felt);
  const Wrench weight = controller_.bears_weight(device) ? felt.weight : Wrench(Wrench::Zero());
  const bool coupled = controller_.kind() == ControllerKind::kVirtualCoupler;
  const Wrench impulse = coupled ? Wrench(Wrench::Zero()) : felt.impulse;
  // Virtual work: while its opening goes from 0 to 1 its finger goes its travel.
  const double travel = port_.ratings().gripper_travel;
  if (travel > 0) port_.grip(model_->drives().opening_force() / travel);
  const Fault fault = port_.write(u, impulse, weight, device, record_);
  record_.F_env = felt.F + port_.impulse_wrench();
  if (fault == Fault::kNone && traits(controller_.kind()).replaces_proxy) {
    const double asked = felt.F.dot(device.V_WD);
    const double given = record_.F_command.dot(device.V_WD);
    if (asked != 0) model_->set_rendered(std::clamp(given / asked, 0.0, 1.0));
  }
  return fault;
}

bool Servo::is_plausible(const DeviceState& device) const noexcept {
  const double scale = std::max(1.0, port_.ratings().scale);
  const double rotation_scale = std::max(1.0, port_.ratings().rotation_scale);
  const Twist V = model_->hand_twist();
  const Vector3 away = model_->proxy().X_WH().p - device.X_WD.p;
  return model_->velocity().cwiseAbs().maxCoeff() <= protocol::kLargestSpeed * scale &&
         V.head<3>().norm() <= kLargestHandSpeed * scale &&
         V.tail<3>().norm() <= kLargestHandRate * rotation_scale &&
         away.norm() <= kLargestDistance * scale;
}

void Servo::fail(Fault fault, const char* why) noexcept {
  const Fault before = machine_.fault();
  machine_.fail(fault);
  if (machine_.fault() != before) cause_ = why;
  record_.F_command.setZero();
  port_.cut();
}

void Servo::describe_tick(const Timing& timing) noexcept {
  describe(timing, machine_, link_, session_.step(), record_);
  if (machine_.fault() != Fault::kNone) record_.cause = cause_;
  if (model_) describe(*model_, record_);
  if (model_) scene_.describe(*model_, record_);
  record_.missing_freedoms = session_.missing_freedoms();
  record_.lowered = session_.lowered();
  record_.uses_contacts = traits(controller_.kind()).uses_contacts;
}

void Servo::acknowledge(double now) noexcept {
  engine_.acknowledge(session_.step(), record_.X_WD, record_.V_WD);
  const LocalModel* model = model_ ? &*model_ : nullptr;
  protocol::ProxyState state = proxy_state(record_, session_.step(), session_.updates(), model);
  state.scene = scene_.number();
  record_.adopted = link_.acknowledge(now, state);
  scene_.acknowledge(now, link_);
  // Contacts and impulses of a model that is nowhere may be no numbers.
  const bool nowhere = record_.fault == Fault::kNonFinite || record_.fault == Fault::kImplausible;
  if (model == nullptr || nowhere) return;
  telemetry_.contacts(now, session_.step(), *model, link_);
  const protocol::Impulses impulses = impulses_of(*model, session_.contained_impulses());
  if (!impulses.bodies.empty()) link_.inform(now, impulses);
  tell_held(now, session_.step(), *model, link_);
  model_->report_impulses();
}

}  // namespace hlm::server
