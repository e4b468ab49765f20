// Where datagrams come from and go to: a UDP socket, an in-memory link, a recorded capture, or a
// link around one of these that records or seals.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hlm/common/static_vector.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// An IPv4 endpoint, host byte order.
struct Endpoint {
  std::uint32_t address = 0;
  std::uint16_t port = 0;
  /// Which sealed channel with that address; 0: not sealed.
  std::uint32_t channel = 0;
  /// Of a sender: the address of this machine that it wrote to, where a socket has several; 0: not
  /// known. Replies come from there. It is no part of the sender's identity.
  std::uint32_t asked = 0;

  bool operator==(const Endpoint& other) const noexcept {
    return address == other.address && port == other.port && channel == other.channel;
  }
};

using DatagramBytes = StaticVector<std::byte, kMaxDatagram>;

inline std::span<const std::byte> view(const DatagramBytes& bytes) noexcept {
  return {bytes.data(), bytes.size()};
}

/// Copies at most kMaxDatagram bytes; the vector's own assign() and constructor do it byte by byte.
inline void copy(std::span<const std::byte> from, DatagramBytes& to) noexcept {
  to.resize(from.size(), boost::container::default_init);
  std::ranges::copy(from, to.data());
}

struct Datagram {
  Endpoint peer;  ///< Sender of a received datagram, receiver of a sent one.
  DatagramBytes bytes;
  double waited = 0;  ///< Between its arrival at this machine and receive(), s.
  /// Why a sealing link has refused it; it then has no bytes, and is to be counted.
  std::optional<DropReason> dropped = std::nullopt;
};

class DatagramLink {
 public:
  virtual ~DatagramLink() = default;

  /// Takes the next waiting datagram; false if there is none. Never waits, allocates or throws.
  /// A datagram longer than kMaxDatagram is consumed and reported with empty bytes.
  virtual bool receive(Datagram& datagram) noexcept = 0;
  /// Sends or, where the system refuses, drops. Never waits, allocates or throws.
  virtual void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept = 0;
  /// The session with `peer` began. A link that has room for few peers keeps this one.
  virtual void keep(const Endpoint& /*peer*/) noexcept {}
  /// The session with `peer` is over. A link that has keys for it wipes them.
  virtual void forget(const Endpoint& /*peer*/) noexcept {}
};

}  // namespace hlm::protocol
