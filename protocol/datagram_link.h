// Where datagrams come from and go to: a UDP socket, an in-memory link or a recorded capture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "common/static_vector.h"
#include "protocol/messages.h"

namespace hlm::protocol {

/// An IPv4 endpoint, host byte order.
struct Endpoint {
  std::uint32_t address = 0;
  std::uint16_t port = 0;

  bool operator==(const Endpoint&) const = default;
};

using DatagramBytes = StaticVector<std::byte, kMaxDatagram>;

inline std::span<const std::byte> view(const DatagramBytes& bytes) noexcept {
  return {bytes.data(), bytes.size()};
}

struct Datagram {
  Endpoint peer;  ///< Sender of a received datagram, receiver of a sent one.
  DatagramBytes bytes;
  double waited = 0;  ///< Between its arrival at this machine and receive(), s.
};

class DatagramLink {
 public:
  virtual ~DatagramLink() = default;

  /// Takes the next waiting datagram; false if there is none. Never waits, allocates or throws.
  /// A datagram longer than kMaxDatagram is consumed and reported with empty bytes.
  virtual bool receive(Datagram& datagram) noexcept = 0;
  /// Sends or, where the system refuses, drops. Never waits, allocates or throws.
  virtual void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept = 0;
};

}  // namespace hlm::protocol
