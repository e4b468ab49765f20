#include "hlm/protocol/server_session.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdio>
#include <string>
#include <utility>

#include "hlm/protocol/nanoseconds.h"
#include "hlm/protocol/random_identifier.h"
#include "hlm/protocol/text.h"
#include "hlm/protocol/tool_fit.h"

namespace hlm::protocol {
namespace {

/// A sequence farther ahead than this is no client's: at 60 messages a second this many were lost
/// for 16 s, and the session is long over. Taken, it would make all that follow stale.
constexpr std::uint64_t kLargestSequenceGap = 1000;
/// Between two refusals, s: often enough to be seen, seldom enough not to flood the client.
constexpr double kRefusalPeriod = 0.1;

}  // namespace

ServerSession::ServerSession(DatagramLink& link, ServerSessionOptions options) noexcept
    : link_(link), options_(options), next_id_(options.first_session_id) {}

ServerSession::Inbox ServerSession::poll(double now) noexcept {
  inbox_ = {};
  answered_ = false;
  // A hello ends the poll: what came after it belongs to the session that it may begin.
  for (int i = 0; i < kDatagramsPerPoll && !inbox_.hello && link_.receive(datagram_); ++i) {
    ++statistics_.datagrams;
    const auto reason = datagram_.dropped ? datagram_.dropped : take_datagram(now);
    if (reason) statistics_.drop(*reason);
  }
  if (inbox_.hello || inbox_.goodbye) {
    inbox_.update = nullptr;
    inbox_.control = nullptr;
  }
  inbox_.scene = active_ && !inbox_.hello && !scene_.front().empty();
  return inbox_;
}

std::optional<DropReason> ServerSession::take_datagram(double now) noexcept {
  Header header;
  if (const auto reason = decode_header(view(datagram_.bytes), header)) {
    if (reason == DropReason::kVersion) answer_other_version(now);
    const bool spoiled = reason == DropReason::kMalformed || reason == DropReason::kTruncated;
    if (spoiled && active_ && datagram_.peer == client_.peer) note_refusal(meaning_of(*reason));
    return reason;
  }
  switch (header.type) {
    case MessageType::kHello:
      return take_hello(now, header);
    case MessageType::kContactUpdate:
      return take_update(now, header);
    case MessageType::kControl:
      return take_control(now, header);
    case MessageType::kGoodbye:
      return take_goodbye(now, header);
    case MessageType::kSceneChunk:
      return take_chunk(now, header);
    case MessageType::kWelcome:
    case MessageType::kReject:
    case MessageType::kProxyState:
    case MessageType::kTicks:
    case MessageType::kLocalState:
    case MessageType::kRefusal:
    case MessageType::kImpulses:
    case MessageType::kHeldBodies:
    case MessageType::kSceneState:
      break;
  }
  return DropReason::kUnexpected;
}

std::optional<DropReason> ServerSession::take_hello(double now, const Header& header) noexcept {
  const std::optional<StablePart> stable = read_stable_part(view(datagram_.bytes));
  if (!stable) return DropReason::kMalformed;
  const Applicant applicant{datagram_.peer, stable->nonce};
  if (active_ && applicant == client_) {
    last_heard_ = now;
    if (!answered_) send_welcome(now);
    return std::nullopt;
  }
  // An address alone proves nothing: it can be forged.
  if (active_ && now - last_heard_ <= options_.timeout) {
    turn_away(now, applicant, RejectReason::kBusy, "another session is alive");
    return DropReason::kForeignSession;
  }
  // A late copy of the hello of a session that is over must not begin it again.
  const bool ended_recently = ended_at_ && now - *ended_at_ <= options_.timeout;
  if (ended_recently && applicant == ended_) return DropReason::kStale;
  return assemble_hello(now, header, applicant);
}

std::optional<DropReason> ServerSession::assemble_hello(double now, const Header& header,
                                                        const Applicant& applicant) noexcept {
  if (applicant != applicant_) {
    hello_parts_.restart(statistics_);
    applicant_ = applicant;
  }
  if (const auto error = decode_part(view(datagram_.bytes), hello_)) return error->reason;
  if (const auto reason = hello_parts_.add(header, view(datagram_.bytes), statistics_))
    return reason;
  if (!hello_parts_.complete()) return std::nullopt;

  const std::uint64_t other_parts = hello_parts_.parts().size() - 1;
  if (const auto reason = decode(hello_parts_.parts(), hello_)) {
    statistics_.drop(*reason, other_parts);
    hello_parts_.refuse(header.envelope.sequence, statistics_);
    return reason;
  }
  normalize(hello_.tool, hello_.q);
  if (const auto error = find_error(hello_)) {
    turn_away(now, applicant, RejectReason::kTool, *error);
    statistics_.drop(DropReason::kMalformed, other_parts);
    hello_parts_.refuse(header.envelope.sequence, statistics_);
    return DropReason::kMalformed;
  }
  hello_parts_.accept();
  inbox_.hello = &hello_;
  return std::nullopt;
}

std::optional<DropReason> ServerSession::take_update(double now, const Header& header) noexcept {
  if (!from_client(header)) return DropReason::kForeignSession;
  if (!is_plausible(header)) {
    note_refusal("its sequence is more than 1000 beyond the largest that was taken");
    return DropReason::kMalformed;
  }
  if (const auto reason = update_parts_.judge(header)) return reason;
  ContactUpdate& scratch = updates_[1 - newest_update_];
  const bool begins = !update_parts_.holds(header.envelope.sequence);
  if (const auto error = decode_part(view(datagram_.bytes), scratch)) {
    spoiled_ = spoiled_ || begins;
    ++refused_;
    note_refusal(meaning_of(error->error));
    update_parts_.refuse(header.envelope.sequence, statistics_);
    report_refusal(now, {.refused = header.envelope.sequence,
                         .error = error->error,
                         .item = static_cast<std::uint16_t>(error->in_item ? error->item : 0)});
    return error->reason;
  }
  if (const auto reason = update_parts_.add(header, view(datagram_.bytes), statistics_))
    return reason;
  spoiled_ = spoiled_ && !begins;
  if (update_parts_.complete()) return complete_update(now, header);
  hear(now);
  return std::nullopt;
}

std::optional<DropReason> ServerSession::complete_update(double now,
                                                         const Header& header) noexcept {
  ContactUpdate& update = updates_[1 - newest_update_];
  std::optional<DropReason> reason;
  Refusal refusal{.refused = header.envelope.sequence};
  const bool is_good =
      spoiled_ ? !decode(update_parts_.parts(), update) : is_whole(update_parts_.parts(), update);
  if (!is_good) {
    refusal.error = UpdateError::kLayout;
    reason = DropReason::kMalformed;
  } else {
    normalize(tool_, update.q_VE);
    const auto copied = leave_out_copies(update.poses);
    if (const auto misfit = find_misfit(tool_, update)) {
      refusal.error = misfit->error;
      refusal.whole = misfit->whole;
      refusal.item = static_cast<std::uint16_t>(misfit->contact);
      if (misfit->whole) reason = DropReason::kMalformed;
    } else if (copied) {
      refusal.error = UpdateError::kDuplicate;
      refusal.whole = false;
      refusal.item = static_cast<std::uint16_t>(*copied);
    }
  }
  if (reason) ++refused_;
  if (refusal.error != UpdateError::kNone) report_refusal(now, refusal);
  if (reason) {
    note_refusal(meaning_of(refusal.error));
    statistics_.drop(*reason, update_parts_.parts().size() - 1);
    update_parts_.refuse(header.envelope.sequence, statistics_);
    return reason;
  }
  update_parts_.accept();
  refusal_ = {};
  hear(now);
  heard_ = std::max(heard_, header.envelope.sequence);
  newest_update_ = 1 - newest_update_;
  inbox_.update = &update;
  acknowledged_ = header.envelope;
  received_at_ = now - datagram_.waited;
  const std::uint64_t newest = newest_control_sequence_;
  if (newest > control_sequence_ && newest < header.envelope.sequence) {
    // A copy: another control may come in the same poll, for a later update.
    control_ = newest_control_;
    control_sequence_ = newest;
    inbox_.control = &control_;
  }
  return std::nullopt;
}

void ServerSession::note_refusal(std::string_view why) noexcept {
  inbox_.refused = true;
  refusal_ = why;
}

void ServerSession::report_refusal(double now, Refusal refusal) noexcept {
  if (refusal_sent_ && now - *refusal_sent_ < kRefusalPeriod) return;
  refusal_sent_ = now;
  refusal.count = refused_;
  send(link_, client_.peer, next_envelope(now), refusal);
}

std::optional<DropReason> ServerSession::take_control(double now, const Header& header) noexcept {
  if (!from_client(header)) return DropReason::kForeignSession;
  if (!is_plausible(header)) return DropReason::kMalformed;
  if (header.envelope.sequence <= newest_control_sequence_) return DropReason::kStale;
  Control control;
  if (const auto reason = decode(view(datagram_.bytes), control)) return reason;
  newest_control_ = control;
  newest_control_sequence_ = header.envelope.sequence;
  heard_ = std::max(heard_, header.envelope.sequence);
  hear(now);
  return std::nullopt;
}

std::optional<DropReason> ServerSession::take_goodbye(double now, const Header& header) noexcept {
  if (!from_client(header)) return DropReason::kForeignSession;
  Goodbye goodbye;
  if (const auto reason = decode(view(datagram_.bytes), goodbye)) return reason;
  inbox_.goodbye = true;
  end(now);
  link_.forget(client_.peer);
  return std::nullopt;
}

/// In whatever order they come: a later sequence may carry an earlier chunk.
std::optional<DropReason> ServerSession::take_chunk(double now, const Header& header) noexcept {
  if (!from_client(header)) return DropReason::kForeignSession;
  if (!welcome_.capabilities.scenes) return DropReason::kUnexpected;
  if (!is_plausible(header)) return DropReason::kMalformed;
  SceneChunk chunk;
  if (const auto reason = decode(view(datagram_.bytes), chunk)) return reason;
  if (const auto reason = scene_.take(chunk)) return reason;
  heard_ = std::max(heard_, header.envelope.sequence);
  hear(now);
  return std::nullopt;
}

bool ServerSession::is_plausible(const Header& header) const noexcept {
  return header.envelope.sequence <= heard_ + kLargestSequenceGap;
}

bool ServerSession::from_client(const Header& header) const noexcept {
  return active_ && header.envelope.session == id_ && datagram_.peer == client_.peer;
}

void ServerSession::hear(double now) noexcept {
  last_heard_ = now;
  inbox_.heard = true;
}

void ServerSession::end(double now) noexcept {
  active_ = false;
  ended_ = client_;
  ended_at_ = now;
  update_parts_.restart(statistics_);
}

void ServerSession::accept(double now, const Welcome& welcome) noexcept {
  assert(inbox_.hello);
  if (active_) end(now);
  active_ = true;
  client_ = applicant_;
  link_.keep(client_.peer);
  const std::uint64_t given = std::exchange(next_id_, 0);
  id_ = given != 0 ? given : random_identifier();
  tool_ = hello_.tool;
  welcome_ = welcome;
  welcome_.nonce = applicant_.nonce;
  sent_ = 0;
  last_heard_ = now;
  acknowledged_ = {.sequence = 0};
  heard_ = refused_ = 0;
  refusal_sent_.reset();
  refusal_ = {};
  newest_control_sequence_ = control_sequence_ = 0;
  scene_.restart();
  send_welcome(now);
}

void ServerSession::reject(double now, RejectReason reason, std::string_view text) noexcept {
  assert(inbox_.hello);
  answered_ = false;
  turn_away(now, applicant_, reason, text);
}

std::uint64_t ServerSession::acknowledge(double now, ProxyState state) noexcept {
  if (!active_ || acknowledged_.sequence == 0) return 0;
  state.acknowledged = acknowledged_.sequence;
  state.update_send_time = to_seconds(acknowledged_.send_time);
  state.hold = std::max(0.0, now - received_at_);
  state.dropped = statistics_.total_dropped();
  state.control = control_sequence_;
  send(link_, client_.peer, next_envelope(now), state);
  return state.acknowledged;
}

void ServerSession::close(double now, GoodbyeReason reason) noexcept {
  if (!active_) return;
  send(link_, client_.peer, next_envelope(now), Goodbye{reason});
  end(now);
  link_.forget(client_.peer);
}

void ServerSession::answer_other_version(double now) noexcept {
  const std::optional<StablePart> stable = read_stable_part(view(datagram_.bytes));
  if (!stable || stable->type != MessageType::kHello) return;
  std::array<char, kMaxText> text{};
  std::snprintf(text.data(), text.size(),
                "the server speaks version %d of the protocol, the client version %d",
                int{kProtocolVersion}, int{stable->version});
  turn_away(now, {datagram_.peer, stable->nonce}, RejectReason::kVersion, text.data());
}

void ServerSession::turn_away(double now, const Applicant& applicant, RejectReason reason,
                              std::string_view text) noexcept {
  if (answered_) return;
  answered_ = true;
  Reject reject;
  reject.nonce = applicant.nonce;
  reject.reason = reason;
  reject.text = to_text(text);
  send(link_, applicant.peer, {.sequence = ++sent_outside_, .send_time = to_nanoseconds(now)},
       reject);
}

void ServerSession::send_welcome(double now) noexcept {
  answered_ = true;
  send(link_, client_.peer, next_envelope(now), welcome_);
}

Envelope ServerSession::next_envelope(double now) noexcept {
  return {.session = id_, .sequence = ++sent_, .send_time = to_nanoseconds(now)};
}

}  // namespace hlm::protocol
