// A network that is worse than the one there is: datagrams of both directions are delayed and lost,
// to see what a method makes of it.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <span>

#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/transport/datagram_queue.h"

namespace hlm {

/// Within these a session lives: beyond, its answers come after its client has given it up.
inline constexpr double kLongestDelay = 0.2;    ///< s.
inline constexpr double kLongestJitter = 0.04;  ///< s.
inline constexpr double kLargestLoss = 0.5;

/// What happens to each datagram, in either direction.
struct NetworkConditions {
  double delay = 0;   ///< Held at least this long, s.
  double jitter = 0;  ///< And up to this much longer, uniformly drawn, s. Datagrams may overtake.
  double loss = 0;    ///< Probability that it never arrives.

  bool operator==(const NetworkConditions&) const = default;
};

/// Holds datagrams until pump() finds them ready: call that at least once a millisecond. Without
/// conditions everything passes at once; telemetry always does, it is there to look on. Not
/// thread-safe.
class ImpairedLink final : public protocol::DatagramLink {
 public:
  /// now: a steady clock, s. seed: of jitter and loss. `link` must outlive this.
  ImpairedLink(protocol::DatagramLink& link, std::function<double()> now, std::uint64_t seed)
      : link_(link), now_(std::move(now)), engine_(seed) {}

  /// Holds for datagrams from now on.
  void set_conditions(const NetworkConditions& conditions) { conditions_ = conditions; }

  /// Sends what must go out, and takes what has come.
  void pump();

  bool receive(protocol::Datagram& datagram) noexcept override;
  void send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept override;
  void keep(const protocol::Endpoint& peer) noexcept override { link_.keep(peer); }
  /// What waits to be sent leaves at once: the link below may not be able to send it later.
  void forget(const protocol::Endpoint& peer) noexcept override;

 private:
  void hold(protocol::DatagramQueue& queue, const protocol::Datagram& datagram);

  protocol::DatagramLink& link_;
  std::function<double()> now_;
  std::mt19937_64 engine_;
  NetworkConditions conditions_;
  protocol::DatagramQueue incoming_;
  protocol::DatagramQueue outgoing_;
};

}  // namespace hlm
