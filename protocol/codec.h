// Messages to datagrams and back. PROTOCOL.md is the standard. Nothing here allocates or throws.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/datagram_link.h"
#include "protocol/messages.h"
#include "protocol/statistics.h"

namespace hlm::protocol {

/// Largest number of parts of a message.
inline constexpr std::size_t kMaxParts = 8;

/// What the sender puts on every message.
struct Envelope {
  std::uint64_t session = 0;   ///< 0 in hello and reject, never elsewhere.
  std::uint64_t sequence = 1;  ///< Per sender and session, from 1, one more for each message.
  std::int64_t send_time = 0;  ///< Sender's own steady clock, ns.

  bool operator==(const Envelope&) const = default;
};

/// Which part of a message's list a datagram holds.
struct Slice {
  std::uint8_t part = 0;
  std::uint8_t parts = 1;
  std::uint8_t items = 0;        ///< In this part.
  std::uint8_t items_total = 0;  ///< In all parts.

  bool operator==(const Slice&) const = default;
};

struct Header {
  MessageType type = MessageType::kHello;
  Envelope envelope;
  Slice slice;
};

/// Number of datagrams that the message needs, 1 to kMaxParts.
std::uint8_t part_count(const Hello& hello) noexcept;
std::uint8_t part_count(const ContactUpdate& update) noexcept;
std::uint8_t part_count(const LocalState& state) noexcept;
template <class Message>
std::uint8_t part_count(const Message&) noexcept {
  return 1;
}

/// One part of a message, `part` < part_count(message).
DatagramBytes encode(const Envelope& envelope, const Hello& hello, std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const Welcome& welcome,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const Reject& reject,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const ContactUpdate& update,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const ProxyState& state,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const Goodbye& goodbye,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const Control& control,
                     std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const Ticks& ticks, std::uint8_t part = 0) noexcept;
DatagramBytes encode(const Envelope& envelope, const LocalState& state,
                     std::uint8_t part = 0) noexcept;

/// Sends all parts of a message.
template <class Message>
void send(DatagramLink& link, const Endpoint& to, const Envelope& envelope,
          const Message& message) noexcept {
  const std::uint8_t parts = part_count(message);
  for (std::uint8_t part = 0; part < parts; ++part) {
    link.send(to, view(encode(envelope, message, part)));
  }
}

/// Reads and checks a datagram's header, in the order: size, magic, version, length, the rest.
/// Returns why the datagram is refused; `header` is complete only if nothing is returned.
[[nodiscard]] std::optional<DropReason> decode_header(std::span<const std::byte> bytes,
                                                      Header& header) noexcept;

/// Reads a whole message of one datagram. Checks everything, the header too, but not whether it
/// fits the session's tool (tool_fit.h). Returns why it is refused; the message's value then means
/// nothing.
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Welcome& welcome) noexcept;
/// A reject of any version of the protocol.
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Reject& reject) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               ProxyState& state) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Goodbye& goodbye) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Control& control) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Ticks& ticks) noexcept;

/// The same for a message in parts: all of them, in order. Parts that are not of one message are
/// malformed. A hello's tool may still be unusable (find_error).
[[nodiscard]] std::optional<DropReason> decode(std::span<const DatagramBytes> parts,
                                               Hello& hello) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const DatagramBytes> parts,
                                               ContactUpdate& update) noexcept;
[[nodiscard]] std::optional<DropReason> decode(std::span<const DatagramBytes> parts,
                                               LocalState& state) noexcept;

/// What stands at the same place in every version of the protocol, so that a hello of any version
/// can be answered and a reject of any version be understood.
struct StablePart {
  std::uint16_t version = 0;
  MessageType type = MessageType::kHello;
  std::uint64_t nonce = 0;  ///< Of a hello, welcome or reject; otherwise meaningless.
};
/// Empty if the bytes are too few or the magic is wrong.
std::optional<StablePart> read_stable_part(std::span<const std::byte> bytes) noexcept;

}  // namespace hlm::protocol
