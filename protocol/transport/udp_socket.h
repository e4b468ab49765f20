// Datagrams over UDP and IPv4.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "hlm/protocol/datagram_link.h"

namespace hlm::protocol {

class UdpSocket final : public DatagramLink {
 public:
  /// Opens a socket at `local`; address 0 is every address of this machine, and what is asked at
  /// one of them is answered from there; port 0 is any free port.
  /// Throws std::runtime_error naming the endpoint if it is in use, not of this machine, or a
  /// multicast or broadcast address.
  explicit UdpSocket(const Endpoint& local);
  ~UdpSocket() override;
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;

  bool receive(Datagram& datagram) noexcept override;
  void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override;

  /// Where it is bound, with the port that it was given.
  Endpoint local() const noexcept { return local_; }

 private:
  struct Socket;
  std::unique_ptr<Socket> socket_;
  Endpoint local_;
};

/// The endpoint that "HOST:PORT" names; HOST is an IPv4 address or a name that has one. Throws
/// std::runtime_error naming what is wrong and what is allowed. `lowest_port`: 1, or 0 where any
/// free port will do (listening).
Endpoint resolve(const std::string& host_port, std::uint16_t lowest_port = 1);

/// Whether it is of this machine alone: 127.0.0.0/8.
bool is_loopback(const Endpoint& endpoint) noexcept;

/// Whether the endpoint's address is one of this machine.
bool is_own_address(const Endpoint& endpoint);

/// The endpoint as text, for example "127.0.0.1:47800".
std::string to_string(const Endpoint& endpoint);

}  // namespace hlm::protocol
