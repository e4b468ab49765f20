// Messages to datagrams and back. PROTOCOL.md is the standard. Nothing here allocates or throws.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// Largest number of parts of a message.
inline constexpr std::size_t kMaxParts = 64;

/// What the sender puts on every message.
struct Envelope {
  std::uint64_t session = 0;   ///< 0 in hello and reject, never elsewhere.
  std::uint64_t sequence = 1;  ///< Per sender and session, from 1, one more for each message.
  std::int64_t send_time = 0;  ///< Sender's own steady clock, ns.

  bool operator==(const Envelope&) const = default;
};

struct Header {
  MessageType type = MessageType::kHello;
  Envelope envelope;
  std::uint8_t part = 0;    ///< Which part of the message this is.
  std::uint8_t parts = 1;   ///< Number of parts of the message.
  std::uint16_t block = 0;  ///< Bytes of the fixed fields after the header.
};

/// Number of datagrams that the message needs, 1 to kMaxParts.
template <class Message>
std::uint8_t part_count(const Message& message) noexcept;

/// One part of a message, `part` < part_count(message): header, fixed fields, and its share of the
/// lists.
template <class Message>
DatagramBytes encode(const Envelope& envelope, const Message& message,
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

/// Why a part is refused, and in a contact update, where.
struct PartError {
  DropReason reason = DropReason::kMalformed;
  UpdateError error = UpdateError::kLayout;
  bool in_item = false;
  std::size_t item = 0;  ///< Index in its list, if in_item.
};

/// Reads one part: the fixed fields, and the part's items at their places in the lists, which are
/// given the length of the whole. Checks everything except whether it fits the session's tool
/// (tool_fit.h). What the message held before stays where the part says nothing.
template <class Message>
[[nodiscard]] std::optional<PartError> decode_part(std::span<const std::byte> bytes,
                                                   Message& message) noexcept;

/// Reads a whole message of one datagram. Returns why it is refused; the message's value then means
/// nothing. A reject may be of any version of the protocol.
template <class Message>
[[nodiscard]] std::optional<DropReason> decode(std::span<const std::byte> bytes,
                                               Message& message) noexcept;

/// The same for a message in parts: all of them, in order. Parts that are not of one message are
/// malformed. A hello's tool may still be unusable (find_error).
template <class Message>
[[nodiscard]] std::optional<DropReason> decode(std::span<const DatagramBytes> parts,
                                               Message& message) noexcept;

/// Whether `parts`, which decode_part() has read into `message` one by one, are all parts of one
/// message, in order.
template <class Message>
[[nodiscard]] bool is_whole(std::span<const DatagramBytes> parts, const Message& message) noexcept;

/// What stands at the same place in every version of the protocol, so that a hello of any version
/// can be answered and a reject of any version be understood.
struct StablePart {
  std::uint16_t version = 0;
  MessageType type = MessageType::kHello;
  std::uint64_t nonce = 0;  ///< Nonce of a hello, welcome or reject; otherwise meaningless.
};
/// Empty if the bytes are too few or the magic is wrong.
std::optional<StablePart> read_stable_part(std::span<const std::byte> bytes) noexcept;

}  // namespace hlm::protocol
