#include "hlm/protocol/sealing/sealed_server_link.h"

#include <algorithm>
#include <utility>

namespace hlm::protocol {

SealedServerLink::SealedServerLink(DatagramLink& link, const noise::Key& key,
                                   std::function<double()> clock)
    : link_(link), start_(kPrologue, key), clock_(std::move(clock)) {}

bool SealedServerLink::receive(Datagram& datagram) noexcept {
  // Bounded: what is not answered ends it, and answers have a rate.
  while (link_.receive(datagram)) {
    const Outcome outcome = take(datagram);
    if (outcome.answered) continue;
    datagram.dropped = outcome.dropped;
    if (outcome.dropped) datagram.bytes.clear();
    return true;
  }
  return false;
}

void SealedServerLink::send(const Endpoint& to, std::span<const std::byte> bytes) noexcept {
  std::optional<Slot>* const slot = find(to.channel);
  if (slot == nullptr) return;
  const DatagramBytes packet = (*slot)->channel.seal(bytes);
  if (!packet.empty()) link_.send((*slot)->address, view(packet));
}

void SealedServerLink::keep(const Endpoint& peer) noexcept {
  if (find(peer.channel) != &proven_[1 - kept_]) return;
  proven_[kept_].reset();
  kept_ = 1 - kept_;
}

void SealedServerLink::forget(const Endpoint& peer) noexcept {
  if (std::optional<Slot>* const slot = find(peer.channel)) slot->reset();
}

SealedServerLink::Outcome SealedServerLink::take(Datagram& datagram) noexcept {
  const PacketKind kind = kind_of(view(datagram.bytes));
  if (kind.error) return {kind.error};
  switch (kind.type) {
    case PacketType::kInitiation:
      return take_initiation(datagram);
    case PacketType::kSealed:
      return {take_sealed(datagram)};
    case PacketType::kResponse:
      break;
  }
  return {DropReason::kUnexpected};
}

SealedServerLink::Outcome SealedServerLink::take_initiation(const Datagram& datagram) noexcept {
  const double now = clock_();
  const bool is_repetition = newcomer_ && newcomer_->initiation == datagram.bytes &&
                             newcomer_->slot.address == datagram.peer;
  if (is_repetition) {
    if (!newcomer_->repetitions.take(now)) return {DropReason::kHandshakeRate};
    link_.send(datagram.peer, view(newcomer_->response));
    return {.answered = true};
  }
  if (!trials_.take(now)) return {DropReason::kHandshakeRate};
  noise::Handshake handshake = start_;
  std::array<std::byte, kIndexSize> payload{};
  const auto message = view(datagram.bytes).subspan(kInitiationHeader);
  if (!handshake.read_first(message, payload)) return {DropReason::kWrongKey};
  noise::PublicKey ephemeral;
  std::copy_n(message.begin(), ephemeral.size(), ephemeral.begin());
  if (was_seen(ephemeral)) return {DropReason::kReplayed};
  if (!handshakes_.take(now)) return {DropReason::kHandshakeRate};
  remember(ephemeral);
  if (const auto reason = respond(datagram, handshake, from_payload(payload))) return {reason};
  return {.answered = true};
}

std::optional<DropReason> SealedServerLink::respond(const Datagram& datagram,
                                                    noise::Handshake& handshake,
                                                    ChannelIndex client) noexcept {
  ChannelIndex own = random_index();
  while (find(own) != nullptr) own = random_index();
  DatagramBytes response = response_header(client);
  response.resize(kResponseSize);
  const auto message = std::span(response.data(), response.size()).subspan(kResponseHeader);
  if (!handshake.write_second(noise::random_key_pair(), to_payload(own), message)) {
    return DropReason::kMalformed;
  }
  const noise::TransportKeys keys = handshake.split();
  newcomer_.emplace(
      Newcomer{.slot = {datagram.peer,
                        SealedChannel(own, client, {keys.from_responder, keys.from_initiator})},
               .initiation = datagram.bytes,
               .response = response});
  link_.send(datagram.peer, view(response));
  return std::nullopt;
}

std::optional<DropReason> SealedServerLink::take_sealed(Datagram& datagram) noexcept {
  const ChannelIndex receiver = receiver_of(view(datagram.bytes));
  const bool from_newcomer = newcomer_ && newcomer_->slot.channel.own_index() == receiver;
  std::optional<Slot>* const proven = find(receiver);
  if (!from_newcomer && proven == nullptr) return DropReason::kForeignSession;
  Slot& slot = from_newcomer ? newcomer_->slot : **proven;
  if (slot.address != datagram.peer) return DropReason::kForeignSession;
  if (const auto reason = slot.channel.open(view(datagram.bytes), datagram.bytes)) return reason;
  datagram.peer = slot.peer();
  if (from_newcomer) promote_newcomer();
  return std::nullopt;
}

void SealedServerLink::promote_newcomer() noexcept {
  proven_[1 - kept_] = newcomer_->slot;
  newcomer_.reset();
}

bool SealedServerLink::was_seen(const noise::PublicKey& ephemeral) const noexcept {
  return std::find(seen_.begin(), seen_.end(), ephemeral) != seen_.end();
}

void SealedServerLink::remember(const noise::PublicKey& ephemeral) noexcept {
  seen_[next_seen_] = ephemeral;
  next_seen_ = (next_seen_ + 1) % seen_.size();
}

std::optional<SealedServerLink::Slot>* SealedServerLink::find(ChannelIndex index) noexcept {
  for (std::optional<Slot>& slot : proven_) {
    if (slot && slot->channel.own_index() == index) return &slot;
  }
  return nullptr;
}

}  // namespace hlm::protocol
