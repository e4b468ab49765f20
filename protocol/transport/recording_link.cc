#include "hlm/protocol/transport/recording_link.h"

#include <ctime>
#include <utility>

namespace hlm::protocol {

std::int64_t wall_clock_ns() noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return now.tv_sec * kSecond + now.tv_nsec;
}

RecordingLink::RecordingLink(DatagramLink& link, Endpoint local,
                             std::function<std::int64_t()> clock, std::size_t capacity)
    : link_(link), local_(local), clock_(std::move(clock)), ring_(capacity) {}

bool RecordingLink::receive(Datagram& datagram) noexcept {
  if (!link_.receive(datagram)) return false;
  if (datagram.dropped) return true;
  record(datagram.peer, local_, view(datagram.bytes));
  if (received_.size() < received_.capacity()) received_.push_back(datagram.peer.channel);
  return true;
}

void RecordingLink::send(const Endpoint& to, std::span<const std::byte> bytes) noexcept {
  record(local_, to, bytes);
  link_.send(to, bytes);
}

void RecordingLink::note(std::span<const std::byte> bytes) noexcept {
  record(local_, local_, bytes);
  received_.clear();
}

void RecordingLink::record(const Endpoint& from, const Endpoint& to,
                           std::span<const std::byte> bytes) noexcept {
  // Pointers let the bytes be copied as a block; the span's iterators copy them one by one.
  const CapturedDatagram datagram{
      .time_ns = clock_(),
      .from = from,
      .to = to,
      .bytes = DatagramBytes(bytes.data(), bytes.data() + bytes.size())};
  if (!ring_.push(datagram)) lost_.fetch_add(1, std::memory_order_relaxed);
}

std::size_t RecordingLink::drain(CaptureWriter& capture) {
  const std::size_t waiting = ring_.read_available();
  for (std::size_t i = 0; i < waiting; ++i) {
    ring_.consume_one([&capture](const CapturedDatagram& datagram) {
      capture.write(datagram.time_ns, datagram.from, datagram.to, view(datagram.bytes));
    });
  }
  if (waiting > 0) capture.flush();
  return waiting;
}

}  // namespace hlm::protocol
