// The server's end of sealed datagrams.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/sealing/noise.h"
#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/sealing/sealed_channel.h"
#include "hlm/protocol/sealing/token_bucket.h"

namespace hlm::protocol {

/// Opens what comes over `link` and seals what is sent. It gives Datagram::peer a `channel`, which
/// tells two handshakes from one address apart. There is room for two channels that have proved
/// that they hold the key, by a datagram that opened, and for one that has not: one of the two is
/// that of the session (keep), the other is the latest to ask for it.
class SealedServerLink final : public DatagramLink {
 public:
  /// Handshakes that are answered, a second: each takes some 100 µs of a tick, for its
  /// Diffie-Hellman. More leaves a newcomer less than 0.1 s to prove itself before the next may
  /// take its place; fewer lets newcomers wait longer for each other.
  static constexpr double kHandshakeRate = 10;
  /// First messages that are tried, a second and at once: each takes some 4 µs. More lets a flood
  /// take more of a tick, fewer lets it hide a newcomer's.
  static constexpr double kTrialRate = 16'000;
  static constexpr double kTrialBurst = 16;

  /// `clock` (s, steady) is called in receive(): it must not wait, allocate or throw.
  SealedServerLink(DatagramLink& link, const noise::Key& key,
                   std::function<double()> clock = steady_seconds);

  bool receive(Datagram& datagram) noexcept override;
  void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override;
  void keep(const Endpoint& peer) noexcept override;
  void forget(const Endpoint& peer) noexcept override;

 private:
  /// A channel and the address that its handshake came from: it serves no other.
  struct Slot {
    Endpoint address;
    SealedChannel channel;

    Endpoint peer() const noexcept { return {address.address, address.port, channel.own_index()}; }
  };
  /// A handshake that was answered, and not yet proved.
  struct Newcomer {
    Slot slot;
    DatagramBytes initiation;
    DatagramBytes response;
    TokenBucket repetitions{kHandshakeRate, 1};
  };

  /// What becomes of the packet in `datagram`: opened in place, answered by this link itself, or
  /// dropped.
  struct Outcome {
    std::optional<DropReason> dropped = std::nullopt;
    bool answered = false;
  };
  Outcome take(Datagram& datagram) noexcept;
  Outcome take_initiation(const Datagram& datagram) noexcept;
  std::optional<DropReason> respond(const Datagram& datagram, noise::Handshake& handshake,
                                    ChannelIndex client) noexcept;
  std::optional<DropReason> take_sealed(Datagram& datagram) noexcept;
  void promote_newcomer() noexcept;
  bool was_seen(const noise::PublicKey& ephemeral) const noexcept;
  void remember(const noise::PublicKey& ephemeral) noexcept;
  std::optional<Slot>* find(ChannelIndex index) noexcept;

  DatagramLink& link_;
  noise::Handshake start_;  ///< Before the first message: the same for all.
  std::function<double()> clock_;
  TokenBucket trials_{kTrialRate, kTrialBurst};
  TokenBucket handshakes_{kHandshakeRate, 1};

  std::array<std::optional<Slot>, 2> proven_;
  std::size_t kept_ = 0;  ///< Which of them is the session's.
  std::optional<Newcomer> newcomer_;
  /// Public keys of the latest first messages that were answered, so that their replays are not.
  std::array<noise::PublicKey, 64> seen_{};
  std::size_t next_seen_ = 0;
};

}  // namespace hlm::protocol
