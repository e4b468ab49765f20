// A network in memory: two ends joined by a link that delays, loses, reorders and duplicates
// datagrams, repeatable from a seed, in virtual time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <utility>

#include "hlm/common/uniform.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/transport/datagram_queue.h"

namespace hlm::protocol {

/// What the network does to each datagram, in either direction.
struct LinkConditions {
  double delay = 0;       ///< Every datagram is under way at least this long, s.
  double jitter = 0;      ///< Up to this much longer, uniformly drawn, s. Datagrams may overtake.
  double loss = 0;        ///< Probability that a datagram never arrives.
  double reordering = 0;  ///< Probability that a datagram is held back by `reorder_time`.
  double reorder_time = 0.05;  ///< s.
  double duplication = 0;      ///< Probability that a datagram arrives twice.
};

/// Joins a server's and a client's DatagramLink. What is sent at one end at time t arrives at the
/// other from t + delay on, as soon as set_time() has reached that.
class MemoryNetwork {
 public:
  static constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
  static constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};

  explicit MemoryNetwork(LinkConditions conditions = {}, std::uint64_t seed = 1)
      : conditions_(conditions), engine_(seed) {}
  MemoryNetwork(const MemoryNetwork&) = delete;
  MemoryNetwork& operator=(const MemoryNetwork&) = delete;

  /// The virtual time, s. Never goes back.
  void set_time(double now) noexcept { now_ = std::max(now_, now); }
  double time() const noexcept { return now_; }
  /// Holds for datagrams sent from now on.
  void set_conditions(LinkConditions conditions) noexcept { conditions_ = conditions; }

  /// What happens to the bytes that the client sends from now on.
  void set_alteration(std::function<void(std::span<std::byte>)> alter) {
    alter_ = std::move(alter);
  }

  /// Nothing reaches the server from now on.
  void end_server() noexcept { server_ended_ = true; }

  /// Whether a datagram has arrived that the client has not taken.
  bool client_has_mail() const noexcept { return client_.has_mail(); }

  DatagramLink& server() noexcept { return server_; }
  DatagramLink& client() noexcept { return client_; }

 private:
  class End : public DatagramLink {
   public:
    End(MemoryNetwork& network, Endpoint own) : network_(network), own_(own) {
      // More than is ever under way, so that sending does not allocate.
      constexpr std::size_t kUnderWay = 256;
      incoming_.reserve(kUnderWay);
    }

    bool has_mail() const noexcept { return incoming_.has_due(network_.now_); }
    bool receive(Datagram& datagram) noexcept override {
      return incoming_.take(network_.now_, datagram);
    }
    void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override {
      network_.carry(own_, to, bytes);
    }

   private:
    friend class MemoryNetwork;
    MemoryNetwork& network_;
    Endpoint own_;
    DatagramQueue incoming_;
  };

  void carry(const Endpoint& from, const Endpoint& to, std::span<const std::byte> bytes) {
    if ((to != kServer && to != kClient) || (to == kServer && server_ended_)) return;
    if (drawn(conditions_.loss)) return;
    const int copies = drawn(conditions_.duplication) ? 2 : 1;
    DatagramQueue& incoming = to == kServer ? server_.incoming_ : client_.incoming_;
    DatagramBytes altered;
    copy(bytes, altered);
    if (to == kServer && alter_) alter_({altered.data(), altered.size()});
    for (int i = 0; i < copies; ++i) {
      double arrival = now_ + conditions_.delay + uniform(engine_) * conditions_.jitter;
      if (drawn(conditions_.reordering)) arrival += conditions_.reorder_time;
      incoming.hold(arrival, {from, altered, 0, {}});
    }
  }

  bool drawn(double probability) { return uniform(engine_) < probability; }

  LinkConditions conditions_;
  std::mt19937_64 engine_;
  std::function<void(std::span<std::byte>)> alter_;
  bool server_ended_ = false;
  double now_ = 0;
  End server_{*this, kServer};
  End client_{*this, kClient};
};

}  // namespace hlm::protocol
