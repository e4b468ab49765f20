// What a session tells the program that serves its page, and hears from it: packets over a socket
// pair of one machine and one version.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "hlm/protocol/codec.h"

namespace hlm::page_wire {

/// First byte of each packet.
enum class Kind : std::uint8_t {
  kMessage = 1,     ///< A message of the protocol: its parts, each after its length in two bytes.
  kSceneBegin = 2,  ///< Records of an offered scene follow; a scene that came in part is dropped.
  kScene = 3,       ///< Records (scene_records.h), or a part of one.
  kSceneEnd = 4,    ///< They are all there.
  kStatus = 5,      ///< A Status.
  kAddress = 6,     ///< To the session: where the page is, as text.
  kTrouble = 7,     ///< To the session: why there is no page, as text.
};

struct Status {
  bool connected = false;
  double round_trip = 0;  ///< s.
};

/// Largest packet.
inline constexpr std::size_t kMost = 128 * 1024;

using Packet = std::vector<std::byte>;

inline void append(std::span<const std::byte> bytes, Packet& to) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

inline Packet packet(Kind kind, std::span<const std::byte> bytes = {}) {
  Packet made{static_cast<std::byte>(kind)};
  append(bytes, made);
  return made;
}

template <class Message>
Packet packet(const Message& message, const protocol::Envelope& envelope) {
  Packet made{static_cast<std::byte>(Kind::kMessage)};
  const std::uint8_t parts = protocol::part_count(message);
  for (std::uint8_t part = 0; part < parts; ++part) {
    const protocol::DatagramBytes bytes = protocol::encode(envelope, message, part);
    const auto size = static_cast<std::uint16_t>(bytes.size());
    append(std::as_bytes(std::span(&size, 1)), made);
    append(protocol::view(bytes), made);
  }
  return made;
}

/// The parts of a message in a packet of kMessage, without its first byte; none if it is malformed.
inline std::vector<protocol::DatagramBytes> parts_of(std::span<const std::byte> bytes) {
  std::vector<protocol::DatagramBytes> parts;
  while (bytes.size() >= sizeof(std::uint16_t)) {
    std::uint16_t size = 0;
    std::memcpy(&size, bytes.data(), sizeof size);
    bytes = bytes.subspan(sizeof size);
    if (size > bytes.size() || size > protocol::kMaxDatagram) return {};
    protocol::copy(bytes.first(size), parts.emplace_back());
    bytes = bytes.subspan(size);
  }
  return parts;
}

}  // namespace hlm::page_wire
