// Two directions of sealed datagrams, after a handshake.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "hlm/protocol/sealing/noise.h"
#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/sealing/replay_window.h"

namespace hlm::protocol {

/// The channel's keys go with it. Nothing here waits, allocates or throws.
class SealedChannel {
 public:
  struct Keys {
    noise::Key send;
    noise::Key receive;
  };

  /// `own` and `peer`: the index by which each side is addressed. `first_counter`: of the first
  /// datagram that is sent.
  SealedChannel(ChannelIndex own, ChannelIndex peer, const Keys& keys,
                std::uint64_t first_counter = 0) noexcept
      : own_(own), peer_(peer), keys_(keys), next_counter_(first_counter) {}

  ChannelIndex own_index() const noexcept { return own_; }

  /// `text` (at most kMaxDatagram - kSealRoom bytes), sealed. Empty if the text is longer, or all
  /// counters are used up: a new handshake is needed then.
  DatagramBytes seal(std::span<const std::byte> text) noexcept;

  /// Opens a sealed packet (kind_of) with this channel's index. Returns why it is refused; nothing
  /// has changed then.
  [[nodiscard]] std::optional<DropReason> open(std::span<const std::byte> packet,
                                               DatagramBytes& text) noexcept;

 private:
  ChannelIndex own_;
  ChannelIndex peer_;
  Keys keys_;
  std::uint64_t next_counter_;
  ReplayWindow taken_;
};

}  // namespace hlm::protocol
