#include "hlm/client/haptic_client.h"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "hlm/common/friction_limit.h"

namespace hlm {
namespace {

protocol::Hello hello_of(const HapticClientOptions& options) {
  protocol::Hello hello;
  hello.nonce = options.nonce;
  hello.tool = options.tool;
  hello.q = options.q;
  hello.ve_rate = options.ve_rate;
  hello.epsilon = options.epsilon;
  return hello;
}

protocol::ClientSessionOptions session_options(const HapticClientOptions& options,
                                               protocol::TelemetryObserver& telemetry) {
  protocol::ClientSessionOptions session;
  session.server = options.server;
  session.hello = hello_of(options);
  session.clears_fault = options.clears_fault;
  session.telemetry = &telemetry;
  return session;
}

/// Silence time where there is no server, s.
constexpr double kSilenceAlone = 0.1;

/// How long a world stands still until the server has its shapes, s.
constexpr double kLongestStandstill = 10;

/// Frames in which the tool still carries what lies on it, until the impulses cover whole ones.
/// Fewer let it sink in by some millimetres, more push it twice.
constexpr int kHandOver = 4;

/// Chunks of a scene that one send() may send: 4 MB/s at 60 Hz.
constexpr std::size_t kChunksPerSend = 64;

}  // namespace

HapticClient::HapticClient(protocol::DatagramLink& link, const HapticClientOptions& options)
    : options_(options),
      session_(link, session_options(options, telemetry_)),
      world_time_(1 / options.ve_rate),
      ve_rate_(options.ve_rate),
      tool_links_(options.tool.links.size()) {
  telemetry_.own = options.telemetry;
  update_.q_VE = options.q;
  update_.v_VE = Velocity::Zero(ToolModel(options.tool).dof());
}

void HapticClient::Telemetry::observe(const protocol::Ticks& ticks) {
  if (own != nullptr) own->observe(ticks);
  if (page) page->observe(ticks);
}
void HapticClient::Telemetry::observe(const protocol::LocalState& state) {
  if (own != nullptr) own->observe(state);
  if (page) page->observe(state);
}

const std::string& HapticClient::show(const SessionPageOptions& options) {
  if (!telemetry_.page || telemetry_.page->ended()) {
    protocol::Hello hello = hello_of(options_);
    hello.q = update_.q_VE;
    telemetry_.page.reset();
    telemetry_.page = std::make_unique<SessionPage>(hello, options);
    show_scene();
    if (connected()) telemetry_.page->show_welcome(welcome());
  }
  return telemetry_.page->address();
}

void HapticClient::show_scene() {
  if (!telemetry_.page || !scene_) return;
  protocol::OfferedBefore nothing;
  telemetry_.page->show_scene(protocol::scene_of(*scene_, tool_links_, nothing));
}

void HapticClient::tell_page(double now, const Inbox& inbox) {
  SessionPage& page = *telemetry_.page;
  if (inbox.lost) page.let_go();
  if (inbox.welcomed) page.show_welcome(welcome());
  page.show_news(now, {.connected = connected(), .round_trip = round_trip()}, inbox);
  page.listen(now);
}

void HapticClient::control(const protocol::Control& control) {
  control_ = control;
  protocol::Control asked = telemetry_.page ? telemetry_.page->control(control) : control;
  // What a hand would push the tool into is not there yet.
  if (waits_for_scene()) asked.holds = false;
  session_.set_control(asked);
}

HapticClient::Inbox HapticClient::poll(double now) {
  session_.be_patient(holds() ? kOldestPoses : 0);
  const Inbox inbox = session_.poll(now);
  if (inbox.welcomed || inbox.lost) {
    playout_.reset();
    take_back();
    held_.clear();
  }
  polled_at_ = now;
  is_answered_ = inbox.state != nullptr && inbox.state->acknowledged >= first_in_scene_;
  if (inbox.welcomed) {
    welcomed_at_ = now;
    answered_ = 0;
    offer();
  }
  if (inbox.scene) {
    const protocol::Text& text = scene_state().text;
    scene_problem_.assign(text.begin(), text.end());
  }
  if (inbox.state != nullptr) {
    playout_.hear(inbox.state->step);
    scene_in_force_ = inbox.state->scene > 0;
  }
  hear_held(inbox);
  if (inbox.impulses != nullptr) playout_.receive(*inbox.impulses);
  const double silence_time = connected() ? welcome().silence_time : kSilenceAlone;
  stood_still_ = !world_time_.begin_frame(now, silence_time);
  if (telemetry_.page) tell_page(now, inbox);
  if (telemetry_.page || control_.holds) control(control_);
  return inbox;
}

/// A session begins: it gets the scene, or contacts go on.
void HapticClient::offer() {
  scene_in_force_ = false;
  first_in_scene_ = 0;
  scene_problem_.clear();
  offered_ = {};
  if (scene_) queue_scene();
}

void HapticClient::queue_scene() {
  protocol::OfferedBefore offered = offered_;
  const std::vector<std::uint8_t> records =
      protocol::scene_of(*scene_, tool_links_, offered, welcome().capabilities.holds);
  if (const auto problem = session_.queue_scene(records)) {
    scene_problem_ = *problem;
  } else {
    offered_ = std::move(offered);
  }
}

void HapticClient::offer_scene(protocol::SceneOffer scene) {
  protocol::OfferedBefore nothing;
  protocol::scene_of(scene, tool_links_, nothing);  // Throws.
  scene_ = std::move(scene);
  show_scene();
  if (connected()) queue_scene();
}

bool HapticClient::waits_for_scene() const noexcept {
  return scene_ && connected() && !scene_in_force_ && scene_problem_.empty() &&
         polled_at_ - welcomed_at_ < kLongestStandstill;
}

bool HapticClient::holds() const noexcept {
  return scene_ && !scene_->inertias.empty() && (has_scene() || waits_for_scene()) &&
         welcome().capabilities.holds;
}

bool HapticClient::holds(std::uint32_t body) const noexcept {
  return holds() &&
         std::ranges::find(scene_->inertias, body, &BodyInertia::body) != scene_->inertias.end();
}

bool HapticClient::tool_pushes() const noexcept {
  if (scene_ && !has_scene() && update_.contacts.empty()) return true;  // Nothing of it is felt.
  if (!holds() || !update_.bodies.empty()) return answered_ <= kHandOver;
  return std::ranges::none_of(held_, [](const HeldPlace& body) { return is_held(body.number); });
}

int HapticClient::take_steps(double step) {
  in_real_time_ = true;
  if (!connected() || waits_for_scene()) answered_ = 0;
  if (waits_for_scene()) {
    world_time_ = WorldTime(1 / ve_rate_);
    sampled_at_ = polled_at_;
    update_.ve_period = 0;
    send(polled_at_, {});
    return 0;
  }
  if (stood_still_) playout_.skip();
  const double reported = connected() ? playout_.reported() / welcome().servo_rate : kSilenceAlone;
  const int steps = world_time_.take_steps(step, reported);
  const bool counts = connected() && steps > 0 && (answered_ > 0 || is_answered_);
  if (counts) answered_ = std::min(answered_ + 1, kHandOver + 1);
  return steps;
}

DueImpulses HapticClient::take_impulses(double period) {
  if (!connected()) return {};
  // A world of fixed frames makes up for no stall: what the hand did meanwhile is no push at once.
  // In longer ones the server itself let go.
  const bool short_stall =
      stood_still_ && world_time_.passed() <= welcome().silence_time + 1 / ve_rate_;
  if (short_stall && !in_real_time_) playout_.skip();
  const double usual = in_real_time_ ? 1 / ve_rate_ : 0;
  return playout_.take(period * welcome().servo_rate, usual * welcome().servo_rate);
}

void HapticClient::hear_held(const Inbox& inbox) {
  for (const protocol::HeldBody& body : inbox.held) {
    auto known = std::ranges::find(held_, body.body, &HeldPlace::body);
    if (known == held_.end()) {
      known = held_.insert(held_.end(), HeldPlace());
      known->body = body.body;
    }
    if (body.number < known->number || (body.number == known->number && !is_held(body.number))) {
      continue;
    }
    const bool is_let_go = !is_held(body.number);
    static_cast<protocol::HeldBody&>(*known) = body;
    if (is_let_go) let_go(*known);
  }
}

/// It is placed once more. The newest place counts.
void HapticClient::let_go(const HeldPlace& body) {
  const auto known = std::ranges::find(let_go_, body.body, &HeldPlace::body);
  if (known != let_go_.end()) {
    *known = body;
  } else {
    let_go_.push_back(body);
  }
}

/// Nobody else moves the bodies any more.
void HapticClient::take_back() {
  for (HeldPlace& body : held_) {
    if (is_held(body.number)) take_back(body);
  }
}
void HapticClient::take_back(HeldPlace& body) {
  ++body.number;
  let_go(body);
}

HeldPlaces HapticClient::take_held() {
  if (!holds()) take_back();
  HeldPlaces places = std::exchange(let_go_, {});
  for (const HeldPlace& body : held_) {
    if (is_held(body.number)) places.push_back(body);
  }
  find_joints(places);
  return places;
}

/// What joints connect is held, and let go of, as a whole.
void HapticClient::find_joints(HeldPlaces& places) const {
  if (!scene_) return;
  const auto pose_of = [&](std::uint32_t body) {
    const auto found = std::ranges::find(places, body, &HeldPlace::body);
    if (found == places.end()) return BodyPose();
    return BodyPose{.body = body, .X_WB = found->X_WB, .V_W = found->V_W};
  };
  for (const BodyJoint& joint : scene_->joints) {
    const auto found = std::ranges::find(places, joint.body, &HeldPlace::body);
    if (found == places.end()) continue;
    found->joint = joint_state(joint, pose_of(joint.parent), pose_of(joint.body));
  }
}

void HapticClient::sample(double now, const Configuration& q, const Velocity& v, double period) {
  sampled_at_ = now;
  world_time_.end_steps(now, period);
  update_.ve_time += period;
  update_.ve_period = period;
  update_.q_VE = q;
  update_.v_VE = v;
  update_.external.clear();
  session_.set_initial_configuration(q);
}

void HapticClient::follow_accelerations(const MovableBodies& bodies) {
  update_.rates = trend_.rates(bodies, update_.ve_time);
}

Wrench HapticClient::external(std::uint8_t link) const {
  const auto known = std::ranges::find(update_.external, link, &ExternalWrench::link);
  return known == update_.external.end() ? Wrench(Wrench::Zero()) : known->F_W;
}

void HapticClient::add_external(std::uint8_t link, const Wrench& F_W) {
  if (link >= tool_links_) {
    throw std::invalid_argument("link " + std::to_string(link) +
                                " of an external wrench must be 0 to " +
                                std::to_string(tool_links_ - 1));
  }
  if (F_W.isZero(0)) return;
  const auto known = std::ranges::find(update_.external, link, &ExternalWrench::link);
  if (known == update_.external.end()) {
    update_.external.push_back({.link = link, .F_W = F_W});
  } else {
    known->F_W += F_W;
  }
}

/// What is kept, and what is not there, the server does not hold any more.
void HapticClient::tell_owners(const BodyPoses& poses) {
  update_.owners.clear();
  for (HeldPlace& body : held_) {
    const auto pose = std::ranges::find(poses, body.body, &BodyPose::body);
    if (!is_held(body.number) || (pose != poses.end() && !pose->kept)) continue;
    ++body.number;
    if (pose != poses.end()) {  // It stays where it is now.
      body.X_WB = pose->X_WB;
      body.V_W = pose->V_W;
    }
    let_go(body);
  }
  for (const BodyPose& pose : poses) {
    const auto known = std::ranges::find(held_, pose.body, &HeldPlace::body);
    const bool is_known = known != held_.end();
    if (!is_known && !pose.kept && slowed_ == 0) continue;
    update_.owners.push_back({.body = pose.body,
                              .number = is_known ? known->number : 0,
                              .kept = pose.kept,
                              .slowed = slowed_});
  }
}

std::uint64_t HapticClient::send(double now, const ReportedContacts& contacts,
                                 const MovableBodies& bodies, const BodyPoses& poses) {
  update_.compute_time = now - sampled_at_;
  update_.impulse_step = playout_.step();
  update_.bodies = bodies;
  for (MovableBody& body : update_.bodies) body.P_W = playout_.taken(body.id);
  update_.contacts = contacts;
  for (ReportedContact& contact : update_.contacts) {
    contact.friction = usable_friction(contact.friction);
  }
  update_.poses = poses;
  tell_owners(poses);
  update_.scene = has_scene() ? offered_.scene : 0;
  const std::uint64_t sequence = session_.send(now, update_);
  if (first_in_scene_ == 0 && update_.scene > 0) first_in_scene_ = sequence;
  if (telemetry_.page) telemetry_.page->show_update(now, update_);
  update_.rates.clear();
  session_.send_scene(now, kChunksPerSend);
  return sequence;
}

}  // namespace hlm
