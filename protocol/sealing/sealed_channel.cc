#include "hlm/protocol/sealing/sealed_channel.h"

namespace hlm::protocol {

DatagramBytes SealedChannel::seal(std::span<const std::byte> text) noexcept {
  if (next_counter_ > noise::kLastNonce || text.size() > kMaxDatagram - kSealRoom) return {};
  DatagramBytes packet = sealed_header(peer_, next_counter_);
  packet.resize(kSealRoom + text.size(), boost::container::default_init);
  noise::seal(keys_.send, next_counter_, text,
              std::span(packet.data(), packet.size()).subspan(kSealedHeader));
  ++next_counter_;
  return packet;
}

std::optional<DropReason> SealedChannel::open(std::span<const std::byte> packet,
                                              DatagramBytes& text) noexcept {
  const std::uint64_t counter = counter_of(packet);
  if (counter > noise::kLastNonce) return DropReason::kMalformed;
  if (const auto reason = taken_.judge(counter)) return reason;
  DatagramBytes opened;
  opened.resize(packet.size() - kSealRoom, boost::container::default_init);
  if (!noise::open(keys_.receive, counter, packet.subspan(kSealedHeader),
                   std::span(opened.data(), opened.size()))) {
    return DropReason::kAltered;
  }
  taken_.mark(counter);
  text = opened;
  return std::nullopt;
}

}  // namespace hlm::protocol
