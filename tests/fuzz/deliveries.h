// What comes to a session, and when: the input of the targets `server` and `client`.
#pragma once

#include <cstring>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/layout.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {

/// One datagram. As bytes: wait, traits, size (2, little-endian), then the datagram.
struct Delivery {
  /// A trait: session, sequence, nonce and length are made those of the session, which a sender
  /// on the path knows. Without it mutations seldom come farther than the header.
  static constexpr std::uint8_t kFitted = 1;
  /// A trait: it comes from another address than the peer's.
  static constexpr std::uint8_t kForeign = 2;
  /// A trait: the receiver stood still before it.
  static constexpr std::uint8_t kAfterGap = 4;

  std::uint8_t wait = 0;  ///< Since the one before, ms.
  std::uint8_t traits = kFitted;
  protocol::DatagramBytes bytes;

  bool is(std::uint8_t trait) const { return (traits & trait) != 0; }
};

inline Delivery read_delivery(Input& input) {
  Delivery delivery;
  delivery.wait = input.u8();
  delivery.traits = input.u8();
  const std::size_t size = std::min<std::size_t>(input.u16(), protocol::kMaxDatagram);
  for (const std::uint8_t byte : input.take(size)) delivery.bytes.push_back(std::byte{byte});
  return delivery;
}

inline void write_delivery(const Delivery& delivery, std::vector<std::uint8_t>& to) {
  const std::size_t size = delivery.bytes.size();
  for (const std::size_t byte :
       {std::size_t{delivery.wait}, std::size_t{delivery.traits}, size & 0xFFu, size >> 8}) {
    to.push_back(static_cast<std::uint8_t>(byte));
  }
  for (const std::byte byte : delivery.bytes) to.push_back(std::to_integer<std::uint8_t>(byte));
}

/// Makes datagrams those of a session.
class Fitter {
 public:
  void fit(std::uint64_t session, std::uint64_t nonce, protocol::DatagramBytes& bytes) {
    if (bytes.size() < protocol::layout::kHeaderSize) return;
    const auto type = static_cast<protocol::MessageType>(bytes[kType]);
    const bool is_outside =
        type == protocol::MessageType::kHello || type == protocol::MessageType::kReject;
    if (bytes[kPart] == std::byte{0}) ++sequence_;
    put(bytes, kSession, is_outside ? 0 : session);
    put(bytes, kSequence, sequence_);
    put(bytes, kLength, static_cast<std::uint16_t>(bytes.size()));
    const bool has_nonce = is_outside || type == protocol::MessageType::kWelcome;
    if (has_nonce && nonce != 0) put(bytes, protocol::layout::kHeaderSize, nonce);
  }

 private:
  // Where the header's fields are.
  static constexpr std::size_t kType = 6;
  static constexpr std::size_t kSession = 8;
  static constexpr std::size_t kSequence = 16;
  static constexpr std::size_t kPart = 32;
  static constexpr std::size_t kLength = 36;

  template <class Number>
  static void put(protocol::DatagramBytes& bytes, std::size_t at, Number value) {
    static_assert(std::endian::native == std::endian::little);
    if (at + sizeof value <= bytes.size()) std::memcpy(&bytes[at], &value, sizeof value);
  }

  std::uint64_t sequence_ = 0;
};

}  // namespace hlm::fuzz
