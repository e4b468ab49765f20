// The datagrams of the sealing: PROTOCOL.md, section 8, has their bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/sealing/noise.h"

namespace hlm::protocol {

enum class PacketType : std::uint8_t {
  kInitiation = 1,  ///< Client to server: the first message of a handshake.
  kResponse = 2,    ///< Server to client: the second.
  kSealed = 3,      ///< Either way: a datagram of the protocol, sealed.
};

/// Prologue of the handshake: what both sides must mean.
inline constexpr std::string_view kPrologue = "haptic local model, sealing 1";

/// The receiver's number for a channel, drawn at random, never 0.
using ChannelIndex = std::uint32_t;
inline constexpr std::size_t kIndexSize = 4;

/// Before the handshake's message: type, and of a response the receiver's index.
inline constexpr std::size_t kInitiationHeader = 4;
inline constexpr std::size_t kResponseHeader = 8;
/// Before the sealed datagram: type, receiver's index, counter.
inline constexpr std::size_t kSealedHeader = 16;
/// The payload of either message is the index by which its sender wants to be addressed.
inline constexpr std::size_t kInitiationSize =
    kInitiationHeader + noise::Handshake::message_size(kIndexSize);
inline constexpr std::size_t kResponseSize =
    kResponseHeader + noise::Handshake::message_size(kIndexSize);
static_assert(kSealedHeader + noise::kTagSize == kSealRoom);

/// A packet's type; a type that is not known is given as it is. Otherwise why it is none:
/// truncated, unsealed (a datagram of the protocol as it is), not ours.
struct PacketKind {
  std::optional<DropReason> error;
  PacketType type = PacketType::kSealed;
};
PacketKind kind_of(std::span<const std::byte> packet) noexcept;

/// The index of a response's or sealed datagram's receiver.
ChannelIndex receiver_of(std::span<const std::byte> packet) noexcept;
/// The counter of a sealed datagram.
std::uint64_t counter_of(std::span<const std::byte> packet) noexcept;

/// Headers, alone.
DatagramBytes initiation_header() noexcept;
DatagramBytes response_header(ChannelIndex receiver) noexcept;
DatagramBytes sealed_header(ChannelIndex receiver, std::uint64_t counter) noexcept;

/// An index as a payload, and back.
std::array<std::byte, kIndexSize> to_payload(ChannelIndex index) noexcept;
ChannelIndex from_payload(const std::array<std::byte, kIndexSize>& payload) noexcept;
ChannelIndex random_index() noexcept;

}  // namespace hlm::protocol
