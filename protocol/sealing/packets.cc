#include "hlm/protocol/sealing/packets.h"

#include <algorithm>
#include <cassert>

#include "hlm/protocol/random_identifier.h"
#include "hlm/protocol/wire.h"

namespace hlm::protocol {
namespace {

/// "HLS", then the type.
constexpr std::array kMagic{std::byte{'H'}, std::byte{'L'}, std::byte{'S'}};
/// "HLMI", which datagrams begin with that are not sealed.
constexpr std::array kUnsealedMagic{std::byte{'H'}, std::byte{'L'}, std::byte{'M'}, std::byte{'I'}};

DatagramBytes header_of(PacketType type) noexcept {
  DatagramBytes bytes(kMagic.begin(), kMagic.end());
  Writer(bytes).u8(type);
  return bytes;
}

template <std::size_t n>
bool begins_with(std::span<const std::byte> packet, const std::array<std::byte, n>& magic) {
  return std::equal(magic.begin(), magic.end(), packet.begin());
}

}  // namespace

PacketKind kind_of(std::span<const std::byte> packet) noexcept {
  if (packet.size() < kInitiationHeader) return {DropReason::kTruncated};
  if (begins_with(packet, kUnsealedMagic)) return {DropReason::kUnsealed};
  if (!begins_with(packet, kMagic)) return {DropReason::kNotOurs};
  const auto type = static_cast<PacketType>(packet[kMagic.size()]);
  if (type == PacketType::kSealed && packet.size() < kSealRoom) return {DropReason::kTruncated};
  const bool odd = (type == PacketType::kInitiation && packet.size() != kInitiationSize) ||
                   (type == PacketType::kResponse && packet.size() != kResponseSize);
  if (odd) return {DropReason::kMalformed};
  return {std::nullopt, type};
}

ChannelIndex receiver_of(std::span<const std::byte> packet) noexcept {
  ChannelIndex receiver = 0;
  Reader(packet, kInitiationHeader).u32(receiver);
  return receiver;
}

std::uint64_t counter_of(std::span<const std::byte> packet) noexcept {
  std::uint64_t counter = 0;
  Reader(packet, kResponseHeader).u64(counter);
  return counter;
}

DatagramBytes initiation_header() noexcept { return header_of(PacketType::kInitiation); }

DatagramBytes response_header(ChannelIndex receiver) noexcept {
  DatagramBytes bytes = header_of(PacketType::kResponse);
  Writer(bytes).u32(receiver);
  return bytes;
}

DatagramBytes sealed_header(ChannelIndex receiver, std::uint64_t counter) noexcept {
  DatagramBytes bytes = header_of(PacketType::kSealed);
  Writer writer(bytes);
  writer.u32(receiver);
  writer.u64(counter);
  return bytes;
}

std::array<std::byte, kIndexSize> to_payload(ChannelIndex index) noexcept {
  return std::bit_cast<std::array<std::byte, kIndexSize>>(boost::endian::native_to_little(index));
}

ChannelIndex from_payload(const std::array<std::byte, kIndexSize>& payload) noexcept {
  return boost::endian::little_to_native(std::bit_cast<ChannelIndex>(payload));
}

ChannelIndex random_index() noexcept {
  ChannelIndex index = 0;
  while (index == 0) index = static_cast<ChannelIndex>(random_identifier());
  return index;
}

}  // namespace hlm::protocol
