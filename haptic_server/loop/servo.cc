#include "hlm/haptic_server/loop/servo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/haptic_server/loop/reporting.h"
#include "hlm/protocol/wire.h"

namespace hlm::server {
namespace {

/// Ages beyond this come from a clock gone wrong, s: constraints are not advanced further.
constexpr double kLargestAge = 1.0;

/// What no hand does, with the world scaled to the handle: speed of the proxy's hand, m/s and
/// rad/s, and its distance from the handle, m. More means that contacts carry it away; less would
/// end a session in which a hand is quick, or pulls hard at a proxy that is held.
constexpr double kLargestHandSpeed = 20;
constexpr double kLargestHandRate = 500;
constexpr double kLargestDistance = 5;

/// Time without a guard that is a fault, s: a guard that is only kept waiting is back before.
constexpr double kLongestUnguarded = 0.5;
constexpr const char* kUnguarded =
    "the process that guards its motors is gone or stopped: restart the server";

constexpr const char* kSlowScene = "a scene whose contacts could not be found in time";
constexpr const char* kWarm = "motors get warm: they give their continuous force until they cool";

constexpr const char* kNotFinite = "a number of its state is not finite";

/// Time that ticks with a scene may take beyond their period, s, less what others leave of theirs:
/// more than a busy machine's stalls.
constexpr double kLongestLate = 0.2;
/// How long the contacts of such a scene stay where they are while a client sends none, s.
constexpr double kLongestKept = 1;

/// Force on a proxy among shapes, as a share of the largest on the device: where a hand is stronger
/// than that, the coupling would draw the proxy through what it touches. A plane has no other side.
/// The same for external wrenches: beyond, they are not felt, and would throw the proxy.
constexpr double kLargestPush = 2;

const ReportedContacts kNoContacts;

bool is_finite(const DeviceState& device) noexcept {
  return device.X_WD.p.allFinite() && device.X_WD.R.coeffs().allFinite() &&
         device.V_WD.allFinite() && std::isfinite(device.gripper.value_or(0)) &&
         (!device.F_hand || device.F_hand->allFinite());
}

/// At most `most`, N, and then as a constant force.
void saturate(HandInput& hand, double most) noexcept {
  const double force = hand.F.head<3>().norm();
  if (!(force > most)) return;
  hand.F.head<3>() *= most / force;
  hand.stiffness.head<3>().setZero();
}

}  // namespace

Servo::Servo(const ServoOptions& options, std::uint64_t fingerprint,
             protocol::ServerSession& session, Device& device, SceneSource* scenes) noexcept
    : options_(options),
      dt_(1 / options.rate),
      fingerprint_(fingerprint),
      session_(session),
      device_(device),
      scenes_(scenes),
      controller_(options.controller, options.gains),
      limiter_(options.limits, device.ratings(), dt_),
      energy_(device.ratings(),
              ForceBudget::of(options.limits, device.ratings(), dt_).energy.capacity, dt_),
      largest_force_(ForceBudget::of(options.limits, device.ratings(), dt_).max_force),
      machine_(dt_) {}

const TickRecord& Servo::tick(const Timing& timing) noexcept {
  const protocol::ServerSession::Inbox inbox = session_.poll(timing.begin);
  record_ = TickRecord{};
  exchange_ = {};
  scene_exchange_ = {};
  had_session_ = machine_.simulates();
  if (machine_.simulates() && step_ > 0) miss(timing.missed);
  advance_session(inbox, timing);
  if (scenes_ != nullptr) load_scene(inbox, timing);
  if (inbox.control != nullptr && machine_.simulates()) apply(*inbox.control);
  if (inbox.update != nullptr && machine_.simulates()) adopt(*inbox.update);
  if (inbox.hello != nullptr) begin_session(*inbox.hello, timing.begin);
  if (machine_.simulates()) {
    had_session_ = true;
    simulate();
  }
  describe(timing, machine_, session_, step_, record_);
  if (machine_.fault() != Fault::kNone) record_.cause = cause_;
  if (local_model_) describe(*local_model_, record_);
  if (local_model_ && scene_ != nullptr) {
    record_.scene = scenes_->number();
    record_.placements = static_cast<std::uint32_t>(scene_->shapes());
    record_.pieces = static_cast<std::uint32_t>(scene_->pieces());
    record_.left_out =
        static_cast<std::uint32_t>(local_model_->cut().pairs + local_model_->cut().contacts);
  }
  record_.missing_freedoms = missing_freedoms_;
  record_.lowered = lowered_;
  record_.uses_contacts = traits(controller_.kind()).uses_contacts;
  if (inbox.update != nullptr) acknowledge(timing.begin);
  if (renders_force(machine_.state())) {
    telemetry_.tick(timing.begin, record_, timing.previous_execution, limiter_.limited_by(),
                    session_);
  }
  return record_;
}

/// Periods went by without a tick. The device has held its force, unless its guard has taken the
/// motors off, and the environment's time went on.
void Servo::miss(std::uint64_t periods) noexcept {
  if (static_cast<double>(periods) * dt_ > options_.max_gap) return;  // A fault.
  step_ += periods;
  local_model_->miss(periods, !halted_);
}

void Servo::obey(Intervention intervention) noexcept {
  unguarded_ = intervention == Intervention::kUnguarded;
  switch (intervention) {
    case Intervention::kStop:
      return fail(Fault::kOperatorStop);
    case Intervention::kClear:
      machine_.release();
      return limiter_.settle();
    case Intervention::kHalted:
      halted_ = true;
      return;
    case Intervention::kNone:
    case Intervention::kUnguarded:
      return;
  }
}

void Servo::shut_down(double now) noexcept {
  limiter_.cut();
  device_.write(Wrench::Zero());
  device_.disable();
  session_.close(now, protocol::GoodbyeReason::kShutdown);
  machine_ = SafetyStateMachine(dt_);
  local_model_.reset();
}

/// What the hand holds goes on without its environment for as long as the scene may; what is moved
/// ahead of reports does not.
double Servo::silence_time(double period) const noexcept {
  const bool alone = local_model_ && local_model_->holds() && !local_model_->moves_ahead();
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
  session_.reject(now, protocol::RejectReason::kFault, text.data());
}

void Servo::hear(const protocol::ContactUpdate& update) noexcept {
  oldest_ = oldest_of(update);
  const double silence = silence_time(std::max(period_, update.ve_period));
  if (waits_for_scene(update)) return machine_.stand_by(silence);
  machine_.update(silence, oldest_, has_scene() ? kOldestPoses : kOldestContacts);
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
  if (traits(options_.controller).replaces_proxy && hello.tool.links.size() != 1) {
    session_.reject(now, protocol::RejectReason::kTool,
                    "this controller needs a tool of one link; use another one");
    return;
  }
  local_model_.emplace(hello.tool, hello.q, options_.local_model, dt_);
  local_model_->bound_external(kLargestPush * largest_force_);
  if (scenes_ != nullptr) scenes_->begin(hello.tool);
  scene_ = nullptr;
  counts_on_scene_ = false;
  keeps_contacts_ = 0;
  device_.align(local_model_->proxy().X_WH());
  missing_freedoms_ = missing_freedoms(local_model_->proxy(), device_.ratings().freedoms);
  engine_.begin(local_model_->proxy().X_WH());
  device_.enable();
  limiter_.restart();
  halted_ = false;
  period_ = 1 / hello.ve_rate;
  machine_.begin(silence_time(period_));
  step_ = 0;
  clutched_ = false;
  lowered_ = 0;
  updates_ = 0;
  shortest_travel_.reset();
  contained_impulses_ = 0;
  controller_ = Controller(options_.controller, options_.gains);
  energy_.begin();
  telemetry_.begin();
  session_.accept(now, welcome(options_, fingerprint_, silence_time(period_), device_,
                               {.movable_bodies = true,
                                .self_contacts = true,
                                .scenes = scenes_ != nullptr,
                                .holds = scenes_ != nullptr}));
}

/// Forwards new chunks of the scene stream and adopts the newest scene. Drops a scene that takes
/// too long.
void Servo::load_scene(const protocol::ServerSession::Inbox& inbox, const Timing& timing) noexcept {
  late_ = has_scene() ? std::max(0.0, late_ + timing.previous_execution - dt_) : 0;
  if (late_ > kLongestLate) scenes_->drop({});
  if (inbox.scene) {
    const std::size_t taken = session_.take_scene(
        [this](std::span<const std::byte> bytes) { return scenes_->take(bytes); });
    scene_exchange_.chunks = static_cast<std::uint32_t>(taken);
  }
  Scene* const before = std::exchange(scene_, scenes_->poll());
  if (scene_ != nullptr && scene_ != before && local_model_) {
    const geometry::FinderCut left_out = local_model_->try_scene(*scene_);
    if (left_out != geometry::FinderCut{}) {
      scenes_->drop(left_out);
      scene_ = nullptr;
    }
  }
  if (before != nullptr && scene_ == nullptr) keeps_contacts_ = kLongestKept;
  scene_exchange_.number = scenes_->number();
  use_scene(counts_on_scene_);
}

/// Whether contacts are found in the scene, or are those that the environment reports. Those of one
/// that is dropped stay as they are until others come.
void Servo::use_scene(bool wanted) noexcept {
  counts_on_scene_ = wanted;
  if (!local_model_) return;
  Scene* const scene = wanted ? scene_ : nullptr;
  keeps_contacts_ = wanted && scene == nullptr ? std::max(0.0, keeps_contacts_ - dt_) : 0;
  if (keeps_contacts_ > 0) return local_model_->keep_contacts();
  if (local_model_->scene() != scene || local_model_->keeps_contacts()) {
    local_model_->set_scene(scene);
  }
}

void Servo::apply(const protocol::Control& control) noexcept {
  telemetry_.switch_on(control.telemetry);
  if (GuidedHand* hand = device_.guided_hand()) {
    control.holds ? hand->hold(control.X_WTarget) : hand->release();
  }
  ServoOptions options = control.tuned ? tuned(options_, control.tuning) : options_;
  // A tool of several links cannot take the device's pose; its controller stays.
  const bool possible =
      !traits(options.controller).replaces_proxy || local_model_->proxy().links() == 1;
  if (!possible) options.controller = controller_.kind();
  lowered_ = 0;
  // What it was started with is bounded already.
  if (control.tuned && !options.keep_stiffness) {
    lowered_ = 1 - bound_stiffness(options.controller, device_.ratings(), dt_, options.gains,
                                   options.local_model);
  }
  local_model_->set_parameters(options.local_model);
  controller_ = Controller(options.controller, options.gains);
}

void Servo::advance_session(const protocol::ServerSession::Inbox& inbox,
                            const Timing& timing) noexcept {
  const ServerState before = machine_.state();
  if (inbox.heard) machine_.hear();
  if (inbox.refused) machine_.refuse();
  if (inbox.update != nullptr) hear(*inbox.update);
  if (inbox.goodbye) machine_.end();
  machine_.tick(limiter_.level(), 1 + timing.missed);
  if (static_cast<double>(timing.missed) * dt_ > options_.max_gap && machine_.simulates()) {
    const double gap = static_cast<double>(timing.missed) * dt_;
    const bool by_scene = has_scene() && local_model_->cut() != geometry::FinderCut{} &&
                          timing.previous_execution >= gap;
    fail(by_scene ? Fault::kImplausible : Fault::kOverrun);
    if (by_scene) cause_ = kSlowScene;
  }
  const bool counts = unguarded_ && machine_.simulates();
  unguarded_time_ = counts ? unguarded_time_ + static_cast<double>(1 + timing.missed) * dt_ : 0;
  if (unguarded_time_ > kLongestUnguarded) {
    fail(Fault::kDevice);
    cause_ = kUnguarded;
  }
  limiter_.allow(renders_force(machine_.state()) && !clutched_ && !unguarded_);
  // A hand without force holds nothing, nor moves anybody the bodies; what lives here waits for an
  // environment that is silent.
  const bool waits =
      local_model_ && local_model_->holds() && machine_.fade() == Fade::kClientSilent;
  if (machine_.state() == ServerState::kFading && before != ServerState::kFading) {
    waits ? local_model_->stop_ahead() : local_model_->release_bodies();
  }
  if (machine_.state() == ServerState::kOff && before != ServerState::kOff) {
    device_.disable();
    local_model_.reset();
  }
}

/// The round trip of the update's echo, s; empty if it has none. Counted in steps, not read from
/// clocks, so that a replay finds the same.
std::optional<double> Servo::travel_of(const protocol::ContactUpdate& update) const noexcept {
  if (update.echo_step == 0 || update.echo_step > step_) return std::nullopt;
  const double round_trip = static_cast<double>(step_ - update.echo_step) * dt_;
  return std::max(0.0, round_trip - update.echo_hold);
}

/// The age of the contacts: what the environment says it took, and half the round trip.
double Servo::age_of(const protocol::ContactUpdate& update) const noexcept {
  return std::min(update.compute_time + travel_of(update).value_or(0) / 2, kLargestAge);
}

/// The age that decides whether they give force. Whatever a round trip is longer than the session's
/// shortest may have been the update's way alone: a network that holds everything and then delivers
/// it at once is no slower on the way back. One without an echo may be as old as the session.
double Servo::oldest_of(const protocol::ContactUpdate& update) noexcept {
  const std::optional<double> travel = travel_of(update);
  if (!travel) return update.compute_time + static_cast<double>(step_) * dt_;
  shortest_travel_ = std::min(shortest_travel_.value_or(*travel), *travel);
  return update.compute_time + *travel - *shortest_travel_ / 2;
}

void Servo::adopt(const protocol::ContactUpdate& update) noexcept {
  record_.age = age_of(update);
  // With shapes the update may be older than contacts may.
  const bool uses_contacts = traits(controller_.kind()).uses_contacts;
  const bool young = !has_scene() || oldest_ <= kOldestContacts;
  // A hand without force pushes nothing.
  const bool moves_bodies = uses_contacts && machine_.state() != ServerState::kFading;
  const double stiffness = local_model_->parameters().stiffness;
  const double stored = stored_energy(*local_model_, stiffness);
  use_scene(uses_contacts && update.scene > 0);
  if (keeps_contacts_ > 0) return;  // It does not know yet.
  local_model_->adopt({.contacts = uses_contacts && young ? update.contacts : kNoContacts,
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
                       .holds = moves_bodies});
  energy_.adopted(stored, stored_energy(*local_model_, stiffness));
  contained_impulses_ = update.impulse_step;
  const ToolModel& tool = local_model_->ve_tool();
  engine_.update(update.echo_step, {tool.X_WH(), tool.hand_jacobian().lazyProduct(update.v_VE)});
  ++updates_;
}

void Servo::simulate() noexcept {
  exchange_ = {.read = true, .state = device_.read()};
  const std::optional<DeviceState>& device = exchange_.state;
  if (!device) return fail(Fault::kDevice);
  if (!is_finite(*device)) {
    fail(Fault::kDevice);
    cause_ = kNotFinite;
    return;
  }
  clutched_ = device->clutched;
  if (step_ == 0 || clutched_) X_WStart_ = device->X_WD;
  record_.X_WD = device->X_WD;
  record_.V_WD = device->V_WD;
  record_.hand_measured = device->F_hand.has_value();
  record_.hand_observed = device->hand_observed;
  record_.F_hand = device->F_hand.value_or(Wrench::Zero());
  record_.buttons = device->buttons;
  record_.gripper = device->gripper.value_or(0);
  record_.scale = device_.ratings().scale;
  record_.health = device->health;
  if (device->health != DeviceHealth::kGood) record_.cause = device_.cause();
  limiter_.warm(device->warm);
  if (limiter_.cools() && device->health == DeviceHealth::kGood) {
    record_.health = DeviceHealth::kSaturated;
    record_.cause = kWarm;
  }

  if (!observe(*device)) return;
  // Force rises again from zero when the motors are on again.
  const bool halted = std::exchange(halted_, false);
  if (halted) device_.enable();
  if (halted || device->health == DeviceHealth::kForceOff) limiter_.cut();

  ++step_;
  const ContactWrench felt = move_proxy(*device);
  if (!local_model_->velocity().allFinite() || !felt.F.allFinite()) return fail(Fault::kNonFinite);
  if (!is_plausible(*device)) return fail(Fault::kImplausible);
  render(*device, felt);
}

/// Keeps the port's ledger. Whether the handle and what it was given are within their limits.
bool Servo::observe(const DeviceState& device) noexcept {
  Fault fault = options_.handle.exceeded(X_WStart_, device.X_WD, device.V_WD,
                                         device_.ratings().scale, device_.ratings().rotation_scale);
  // For how long of a stall the motors were on is not known: only what they may have given counts.
  if (halted_ && limiter_.work_until(device.X_WD) < 0) limiter_.cut();
  limiter_.observe(device.X_WD, energy_.supply());
  record_.port = limiter_.ledger();
  record_.port_bound = limiter_.energy_bound();
  record_.port_power = limiter_.power_bound();
  energy_.observe(device.X_WD, device.V_WD, record_.port);
  record_.brought = energy_.brought();
  if (fault == Fault::kNone && limiter_.overdrawn()) fault = Fault::kEnergy;
  if (fault != Fault::kNone) fail(fault);
  return fault == Fault::kNone;
}

ContactWrench Servo::move_proxy(const DeviceState& device) noexcept {
  const ToolModel& proxy = local_model_->proxy();
  if (traits(controller_.kind()).replaces_proxy) {
    // begin_session() and apply() have made sure of one link.
    const std::optional<ToolAtHand> tool = tool_at_hand(proxy, device.X_WD, device.V_WD);
    const ContactWrench felt = local_model_->follow(tool->q, tool->v);
    energy_.follow(limiter_.explained(environment_power(*local_model_)));
    return felt;
  }
  return step_proxy(device);
}

/// The proxy's step. What hand and weight put into the proxy and it did not keep went on into
/// contacts and coupling; moving constraints push the proxy and, except with a coupler, the device.
/// All in J at the handle.
ContactWrench Servo::step_proxy(const DeviceState& device) noexcept {
  const ToolModel& proxy = local_model_->proxy();
  const Pose X_WP = proxy.X_WH();
  HandInput hand = controller_.to_proxy(device, {proxy.X_WH(), local_model_->hand_twist()});
  if (has_scene()) saturate(hand, kLargestPush * largest_force_);
  // What bears it is not known yet.
  const bool floats = machine_.state() == ServerState::kArming;
  const ContactWrench felt = local_model_->step(hand, floats);
  const Wrench F_hand = controller_.passes_hand_wrench(device) ? *device.F_hand : Wrench::Zero();
  energy_.step(*local_model_, X_WP, F_hand, device.hand_observed,
               limiter_.explained(environment_power(*local_model_)),
               controller_.kind() != ControllerKind::kVirtualCoupler);
  return felt;
}

void Servo::render(const DeviceState& device, const ContactWrench& felt) noexcept {
  const HandMotion proxy{local_model_->proxy().X_WH(), local_model_->hand_twist()};
  const bool as_seen = controller_.kind() == ControllerKind::kEngineForce;
  const Wrench u =
      controller_.to_device(as_seen ? engine_.device() : device, proxy, engine_.tool(), felt);
  const bool bears_weight = controller_.bears_weight(device);
  const Wrench weight = bears_weight ? felt.weight : Wrench(Wrench::Zero());
  Wrench impulse = Wrench::Zero();
  if (controller_.kind() != ControllerKind::kVirtualCoupler) impulse = felt.impulse;
  record_.F_command = limiter_.limit(u, impulse, device.V_WD, weight);
  record_.F_env = felt.F + limiter_.impulse_wrench();
  record_.limit = limiter_.limited_by();
  if (limiter_.met_non_finite()) return fail(Fault::kNonFinite);
  if (traits(controller_.kind()).replaces_proxy) {
    const double asked = felt.F.dot(device.V_WD);
    const double given = record_.F_command.dot(device.V_WD);
    if (asked != 0) local_model_->set_rendered(std::clamp(given / asked, 0.0, 1.0));
  }
  exchange_.written = device_.write(record_.F_command);
  if (!exchange_.written) fail(Fault::kDevice);
}

bool Servo::is_plausible(const DeviceState& device) const noexcept {
  const double scale = std::max(1.0, device_.ratings().scale);
  const double rotation_scale = std::max(1.0, device_.ratings().rotation_scale);
  const Twist V = local_model_->hand_twist();
  const Vector3 away = local_model_->proxy().X_WH().p - device.X_WD.p;
  return local_model_->velocity().cwiseAbs().maxCoeff() <= protocol::kLargestSpeed * scale &&
         V.head<3>().norm() <= kLargestHandSpeed * scale &&
         V.tail<3>().norm() <= kLargestHandRate * rotation_scale &&
         away.norm() <= kLargestDistance * scale;
}

void Servo::fail(Fault fault) noexcept {
  const Fault before = machine_.fault();
  machine_.fail(fault);
  if (machine_.fault() != before) cause_ = fault == Fault::kDevice ? device_.cause() : "";
  limiter_.cut();
  record_.F_command.setZero();
  device_.write(Wrench::Zero());
  device_.disable();
}

void Servo::acknowledge(double now) noexcept {
  engine_.acknowledge(step_, record_.X_WD, record_.V_WD);
  const LocalModel* model = local_model_ ? &*local_model_ : nullptr;
  protocol::ProxyState state = proxy_state(record_, step_, updates_, model);
  if (scenes_ != nullptr) state.scene = scenes_->number();
  record_.adopted = session_.acknowledge(now, state);
  if (session_.has_scene()) session_.inform(now, scenes_->state());
  // Contacts and impulses of a model that is nowhere may be no numbers.
  const bool nowhere = record_.fault == Fault::kNonFinite || record_.fault == Fault::kImplausible;
  if (model == nullptr || nowhere) return;
  telemetry_.contacts(now, step_, *model, session_);
  const protocol::Impulses impulses = impulses_of(*model, contained_impulses_);
  if (!impulses.bodies.empty()) session_.inform(now, impulses);
  tell_held(now, step_, *model, session_);
  local_model_->report_impulses();
}

}  // namespace hlm::server
