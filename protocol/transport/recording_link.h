// A link that records what passes over it, without making it wait.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>

#include <boost/lockfree/spsc_queue.hpp>

#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/transport/capture.h"

namespace hlm::protocol {

/// The system's wall clock: ns since the epoch.
std::int64_t wall_clock_ns() noexcept;

/// Copies each datagram that passes `link`, with the time, into a bounded ring; what the link has
/// refused it leaves out. One thread receives and sends; another may drain the ring meanwhile.
class RecordingLink final : public DatagramLink {
 public:
  /// Channels of received datagrams; more than a server takes in one tick are not listed.
  using Channels = StaticVector<std::uint32_t, 64>;
  /// Datagrams the ring holds by default, 20 MB: a quarter of a second of the worst flood that a
  /// session takes, 64 datagrams a tick. A shorter ring must be drained more often.
  static constexpr std::size_t kDefaultCapacity = 16384;

  /// `local` is this side's endpoint in the capture. `clock` (ns since the epoch, >= 0) is called
  /// in receive() and send(): it must not wait, allocate or throw. `capacity` is in datagrams, > 0.
  RecordingLink(DatagramLink& link, Endpoint local,
                std::function<std::int64_t()> clock = wall_clock_ns,
                std::size_t capacity = kDefaultCapacity);

  bool receive(Datagram& datagram) noexcept override;
  void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override;
  void keep(const Endpoint& peer) noexcept override { link_.keep(peer); }
  void forget(const Endpoint& peer) noexcept override { link_.forget(peer); }

  /// Records what is no datagram but belongs between those that have passed and those to come: from
  /// this side to itself, at most kMaxDatagram.
  void note(std::span<const std::byte> bytes) noexcept;
  /// Channels of the datagrams received since the latest note, in order.
  const Channels& received() const noexcept { return received_; }

  /// Moves what the ring held to the capture, and flushes that if there was anything. Returns how
  /// many datagrams it was. Throws what CaptureWriter::flush throws.
  std::size_t drain(CaptureWriter& capture);
  /// Datagrams that passed but found the ring full.
  std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

 private:
  void record(const Endpoint& from, const Endpoint& to, std::span<const std::byte> bytes) noexcept;

  DatagramLink& link_;
  Endpoint local_;
  std::function<std::int64_t()> clock_;
  boost::lockfree::spsc_queue<CapturedDatagram> ring_;
  Channels received_;
  std::atomic<std::uint64_t> lost_{0};
};

}  // namespace hlm::protocol
