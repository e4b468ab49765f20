#include "hlm/protocol/client_session.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "hlm/protocol/nanoseconds.h"
#include "hlm/protocol/random_identifier.h"
#include "hlm/protocol/tool_fit.h"

namespace hlm::protocol {
namespace {

bool is_of_clients(MessageType type) noexcept {
  return type == MessageType::kHello || type == MessageType::kContactUpdate ||
         type == MessageType::kControl || type == MessageType::kSceneChunk;
}

/// A person's act that ends a fault is of now, s. A client that waits for its turn must not end one
/// that comes later.
constexpr double kActLasts = 2;

/// Round trips are no longer than this, s: a server that answers later was not there.
constexpr double kLongestRoundTrip = 2;

}  // namespace

ClientSession::ClientSession(DatagramLink& link, ClientSessionOptions options)
    : link_(link), options_(std::move(options)) {
  if (options_.server.port == 0) throw std::invalid_argument("server's port 0 must be 1 to 65535");
  if (const auto error = find_error(options_.hello)) throw std::invalid_argument(*error);
  if (options_.hello.nonce == 0) options_.hello.nonce = random_identifier();
  options_.hello.clears_fault = options_.clears_fault;
}

ClientSession::Inbox ClientSession::poll(double now) {
  inbox_ = {};
  for (int i = 0; i < kDatagramsPerPoll && link_.receive(datagram_); ++i) {
    ++statistics_.datagrams;
    const auto reason = datagram_.dropped ? datagram_.dropped : take_datagram(now);
    if (reason) statistics_.drop(*reason);
  }
  const double round_trip = std::min(std::max(round_trip_, first_round_trip_), kLongestRoundTrip);
  const double patience = std::max(options_.timeout, least_patience_) + round_trip;
  if (active_ && unanswered_since_ && now - *unanswered_since_ > patience) end();
  const bool hello_due = !last_hello_ || now - *last_hello_ >= options_.hello_period;
  if (!active_ && hello_due) say_hello(now);
  return inbox_;
}

std::optional<DropReason> ClientSession::take_datagram(double now) {
  const bool from_server = datagram_.peer == options_.server;
  Header header;
  if (const auto reason = decode_header(view(datagram_.bytes), header)) {
    const bool other_version = reason == DropReason::kVersion && from_server;
    return other_version && !take_reject() ? std::nullopt : reason;
  }
  if (is_of_clients(header.type)) return DropReason::kUnexpected;
  if (!from_server) return DropReason::kForeignSession;
  switch (header.type) {
    case MessageType::kWelcome:
      return take_welcome(now, header);
    case MessageType::kReject:
      return take_reject();
    case MessageType::kProxyState:
      return take_state(now, header);
    case MessageType::kGoodbye:
      return take_goodbye(header);
    case MessageType::kTicks:
      return take_ticks(header);
    case MessageType::kLocalState:
      return take_local_state(header);
    case MessageType::kRefusal:
      return take_refusal(header);
    case MessageType::kImpulses:
      return take_impulses(header);
    case MessageType::kHeldBodies:
      return take_held(header);
    case MessageType::kSceneState:
      return take_scene_state(now, header);
    case MessageType::kHello:
    case MessageType::kContactUpdate:
    case MessageType::kControl:
    case MessageType::kSceneChunk:
      break;
  }
  return DropReason::kUnexpected;
}

std::optional<DropReason> ClientSession::take_welcome(double now, const Header& header) noexcept {
  Welcome welcome;
  if (const auto reason = decode(view(datagram_.bytes), welcome)) return reason;
  if (welcome.nonce != options_.hello.nonce) return DropReason::kForeignSession;
  if (active_) return DropReason::kStale;
  active_ = true;
  const double asked_for = now - datagram_.waited - asked_at_.value_or(now);
  first_round_trip_ = asked_for <= kLongestRoundTrip ? std::max(0.0, asked_for) : 0;
  options_.hello.clears_fault = false;
  id_ = header.envelope.session;
  welcome_ = welcome;
  sent_ = 0;
  received_ = header.envelope.sequence;
  unanswered_since_.reset();
  state_ = {};
  state_received_at_ = now - datagram_.waited;
  impulses_ = {};
  held_step_ = 0;
  control_sequence_ = 0;
  next_step_ = 1;
  local_state_parts_.restart(statistics_);
  scene_sender_.restart();
  scene_state_ = {};
  scene_sequence_ = 0;
  inbox_.welcomed = true;
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_reject() noexcept {
  Reject reject;
  if (const auto reason = decode(view(datagram_.bytes), reject)) return reason;
  if (reject.nonce != options_.hello.nonce) return DropReason::kForeignSession;
  if (active_) return DropReason::kStale;
  inbox_.reject = reject;
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_state(double now, const Header& header) noexcept {
  if (const auto reason = check_session(header)) return reason;
  ProxyState state;
  if (const auto reason = decode(view(datagram_.bytes), state)) return reason;
  normalize(options_.hello.tool, state.q);
  if (!fits(options_.hello.tool, state)) return DropReason::kMalformed;
  received_ = header.envelope.sequence;
  unanswered_since_.reset();
  state_ = state;
  state_received_at_ = now - datagram_.waited;
  round_trip_ = std::max(0.0, state_received_at_ - state.update_send_time - state.hold);
  inbox_.state = &state_;
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_goodbye(const Header& header) noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  Goodbye goodbye;
  if (const auto reason = decode(view(datagram_.bytes), goodbye)) return reason;
  end();
  return std::nullopt;
}

/// The rule that the latest wins is not for ticks: each counts, and telemetry must not make a proxy
/// state stale.
std::optional<DropReason> ClientSession::take_ticks(const Header& header) {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  Ticks ticks;
  if (const auto reason = decode(view(datagram_.bytes), ticks)) return reason;
  if (ticks.first_step < next_step_) return DropReason::kStale;
  next_step_ = ticks.first_step + ticks.ticks.size();
  if (options_.telemetry) options_.telemetry->observe(ticks);
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_local_state(const Header& header) {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  LocalState state;
  if (const auto error = decode_part(view(datagram_.bytes), state)) return error->reason;
  if (const auto reason = local_state_parts_.add(header, view(datagram_.bytes), statistics_)) {
    return reason;
  }
  if (!local_state_parts_.complete()) return std::nullopt;
  if (const auto reason = decode(local_state_parts_.parts(), state)) {
    statistics_.drop(*reason, local_state_parts_.parts().size() - 1);
    local_state_parts_.refuse(header.envelope.sequence, statistics_);
    return reason;
  }
  local_state_parts_.accept();
  if (options_.telemetry) options_.telemetry->observe(state);
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_refusal(const Header& header) noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  Refusal refusal;
  if (const auto reason = decode(view(datagram_.bytes), refusal)) return reason;
  inbox_.refusal = refusal;
  // The server lives, and would refuse in a new session what it refuses in this one.
  unanswered_since_.reset();
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_impulses(const Header& header) noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  Impulses impulses;
  if (const auto reason = decode(view(datagram_.bytes), impulses)) return reason;
  if (impulses.step < impulses_.step) return DropReason::kStale;
  impulses_ = impulses;
  inbox_.impulses = &impulses_;
  return std::nullopt;
}

/// Messages of one step come one after another; which body is how new its number says.
std::optional<DropReason> ClientSession::take_held(const Header& header) noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  HeldBodies held;
  if (const auto reason = decode(view(datagram_.bytes), held)) return reason;
  if (held.step < held_step_) return DropReason::kStale;
  held_step_ = held.step;
  for (const HeldBody& body : held.bodies) {
    const auto known = std::ranges::find(inbox_.held, body.body, &HeldBody::body);
    if (known != inbox_.held.end()) {
      *known = body;
    } else if (inbox_.held.size() < inbox_.held.capacity()) {
      inbox_.held.push_back(body);
    }
  }
  return std::nullopt;
}

std::optional<DropReason> ClientSession::take_scene_state(double now,
                                                          const Header& header) noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  if (header.envelope.sequence <= scene_sequence_) return DropReason::kStale;
  SceneState state;
  if (const auto reason = decode(view(datagram_.bytes), state)) return reason;
  if (!scene_sender_.receive(now - datagram_.waited, state)) return DropReason::kMalformed;
  scene_sequence_ = header.envelope.sequence;
  scene_state_ = state;
  inbox_.scene = true;
  return std::nullopt;
}

std::optional<DropReason> ClientSession::check_session(const Header& header) const noexcept {
  if (!active_ || header.envelope.session != id_) return DropReason::kForeignSession;
  if (header.envelope.sequence <= received_) return DropReason::kStale;
  return std::nullopt;
}

std::uint64_t ClientSession::send(double now, ContactUpdate update) {
  if (!active_) return 0;
  update.echo_step = state_.step;
  update.echo_hold = std::max(0.0, now - state_received_at_);
  if (control_ && (control_sequence_ == 0 || state_.control < control_sequence_)) {
    const Envelope envelope = next_envelope(now);
    protocol::send(link_, options_.server, envelope, *control_);
    if (control_sequence_ == 0) control_sequence_ = envelope.sequence;
  }
  protocol::send(link_, options_.server, next_envelope(now), update);
  if (!unanswered_since_) unanswered_since_ = now;
  return sent_;
}

std::optional<Sentence> ClientSession::queue_scene(std::span<const std::uint8_t> records) {
  if (!active_) return "there is no session to send a scene in";
  if (!welcome_.capabilities.scenes) return "the server takes no scenes: it is older, or set so";
  if (scene_sender_.queue(records)) return std::nullopt;
  return Sentence("a scene of ") + records.size() + " bytes must be at most " +
         (SceneSender::kMostQueued - scene_sender_.waiting()) + ", with what waits " +
         SceneSender::kMostQueued;
}

std::size_t ClientSession::send_scene(double now, std::size_t budget) {
  if (!active_) return 0;
  return scene_sender_.send(now, budget, [&](const SceneChunk& chunk) {
    protocol::send(link_, options_.server, next_envelope(now), chunk);
  });
}

void ClientSession::set_control(const Control& control) {
  if (control_ == control) return;
  control_ = control;
  control_sequence_ = 0;
}

void ClientSession::close(double now) {
  if (!active_) return;
  protocol::send(link_, options_.server, next_envelope(now), Goodbye{GoodbyeReason::kFinished});
  end();
}

void ClientSession::say_hello(double now) noexcept {
  if (!asking_since_) asking_since_ = now;
  if (!asked_at_) asked_at_ = now;
  if (now - *asking_since_ > kActLasts) options_.hello.clears_fault = false;
  protocol::send(link_, options_.server, {.sequence = ++hellos_, .send_time = to_nanoseconds(now)},
                 options_.hello);
  last_hello_ = now;
}

void ClientSession::end() noexcept {
  active_ = false;
  asked_at_.reset();
  inbox_.lost = true;
  options_.hello.nonce = random_identifier();
  link_.forget(options_.server);
}

Envelope ClientSession::next_envelope(double now) noexcept {
  return {.session = id_, .sequence = ++sent_, .send_time = to_nanoseconds(now)};
}

}  // namespace hlm::protocol
