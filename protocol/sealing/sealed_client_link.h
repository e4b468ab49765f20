// The client's end of sealed datagrams.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>

#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/sealing/noise.h"
#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/sealing/sealed_channel.h"

namespace hlm::protocol {

/// Seals what is sent to one server and opens what comes from it. While there is no channel, what
/// is to be sent starts or repeats a handshake in its stead and is lost: hellos are repeated. Not
/// thread-safe.
class SealedClientLink final : public DatagramLink {
 public:
  /// A first message is repeated after this long, s.
  static constexpr double kRepetitionPeriod = 0.05;
  /// A server that has not answered for this long although it was spoken to is asked again, with
  /// other numbers, s: it may have been restarted.
  static constexpr double kPatience = 0.5;

  /// `clock` (s, steady) is called in send(): it must not wait, allocate or throw.
  SealedClientLink(DatagramLink& link, const Endpoint& server, const noise::Key& key,
                   std::function<double()> clock = steady_seconds);

  bool receive(Datagram& datagram) noexcept override;
  void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override;
  /// The next session has fresh keys.
  void forget(const Endpoint& peer) noexcept override;

 private:
  /// A handshake that waits for its second message.
  struct Attempt {
    noise::Handshake handshake;
    ChannelIndex own;
    DatagramBytes initiation;
    double begun = 0;  ///< s.
    double sent = 0;   ///< s.
  };

  void ask(double now) noexcept;
  void begin(double now) noexcept;
  /// What becomes of a packet: a response is taken by the link itself.
  std::optional<DropReason> take(Datagram& datagram, bool& is_response) noexcept;
  std::optional<DropReason> take_response(std::span<const std::byte> packet) noexcept;
  std::optional<DropReason> take_sealed(Datagram& datagram) noexcept;

  DatagramLink& link_;
  Endpoint server_;
  noise::Handshake start_;  ///< Before the first message.
  std::function<double()> clock_;
  std::optional<Attempt> attempt_;
  std::optional<SealedChannel> channel_;
  std::optional<double> unanswered_since_;  ///< First datagram after the server was last heard, s.
};

}  // namespace hlm::protocol
