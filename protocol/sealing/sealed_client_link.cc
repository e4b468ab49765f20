#include "hlm/protocol/sealing/sealed_client_link.h"

#include <utility>

namespace hlm::protocol {

SealedClientLink::SealedClientLink(DatagramLink& link, const Endpoint& server,
                                   const noise::Key& key, std::function<double()> clock)
    : link_(link), server_(server), start_(kPrologue, key), clock_(std::move(clock)) {}

bool SealedClientLink::receive(Datagram& datagram) noexcept {
  // Bounded: each handshake takes one response.
  while (link_.receive(datagram)) {
    bool is_response = false;
    datagram.dropped = take(datagram, is_response);
    if (is_response && !datagram.dropped) continue;
    if (datagram.dropped) datagram.bytes.clear();
    return true;
  }
  return false;
}

void SealedClientLink::send(const Endpoint& to, std::span<const std::byte> bytes) noexcept {
  if (to != server_) return;
  const double now = clock_();
  if (unanswered_since_ && now - *unanswered_since_ > kPatience) forget(server_);
  if (!channel_) return ask(now);
  const DatagramBytes packet = channel_->seal(bytes);
  if (packet.empty()) return forget(server_);
  link_.send(server_, view(packet));
  if (!unanswered_since_) unanswered_since_ = now;
}

void SealedClientLink::forget(const Endpoint& peer) noexcept {
  if (peer != server_) return;
  attempt_.reset();
  channel_.reset();
  unanswered_since_.reset();
}

void SealedClientLink::ask(double now) noexcept {
  // A server that has lost count of this handshake takes its first message for a replay.
  if (!attempt_ || now - attempt_->begun > kPatience) return begin(now);
  if (now - attempt_->sent < kRepetitionPeriod) return;
  attempt_->sent = now;
  link_.send(server_, view(attempt_->initiation));
}

void SealedClientLink::begin(double now) noexcept {
  DatagramBytes initiation = initiation_header();
  initiation.resize(kInitiationSize);
  attempt_.emplace(Attempt{
      .handshake = start_, .own = random_index(), .initiation = {}, .begun = now, .sent = now});
  attempt_->handshake.write_first(
      noise::random_key_pair(), to_payload(attempt_->own),
      std::span(initiation.data(), initiation.size()).subspan(kInitiationHeader));
  attempt_->initiation = initiation;
  link_.send(server_, view(initiation));
}

std::optional<DropReason> SealedClientLink::take(Datagram& datagram, bool& is_response) noexcept {
  const PacketKind kind = kind_of(view(datagram.bytes));
  if (kind.error) return kind.error;
  if (datagram.peer != server_) return DropReason::kForeignSession;
  is_response = kind.type == PacketType::kResponse;
  if (is_response) return take_response(view(datagram.bytes));
  return kind.type == PacketType::kSealed ? take_sealed(datagram) : DropReason::kUnexpected;
}

std::optional<DropReason> SealedClientLink::take_response(
    std::span<const std::byte> packet) noexcept {
  if (!attempt_ || receiver_of(packet) != attempt_->own) return DropReason::kForeignSession;
  noise::Handshake handshake = attempt_->handshake;
  std::array<std::byte, kIndexSize> payload{};
  if (!handshake.read_second(packet.subspan(kResponseHeader), payload)) {
    return DropReason::kAltered;
  }
  const noise::TransportKeys keys = handshake.split();
  channel_.emplace(attempt_->own, from_payload(payload),
                   SealedChannel::Keys{keys.from_initiator, keys.from_responder});
  attempt_.reset();
  return std::nullopt;
}

std::optional<DropReason> SealedClientLink::take_sealed(Datagram& datagram) noexcept {
  if (!channel_ || receiver_of(view(datagram.bytes)) != channel_->own_index()) {
    return DropReason::kForeignSession;
  }
  if (const auto reason = channel_->open(view(datagram.bytes), datagram.bytes)) return reason;
  unanswered_since_.reset();
  return std::nullopt;
}

}  // namespace hlm::protocol
