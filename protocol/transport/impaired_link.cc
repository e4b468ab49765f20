#include "hlm/protocol/transport/impaired_link.h"

#include <limits>

#include "hlm/common/uniform.h"
#include "hlm/protocol/codec.h"

namespace hlm {
namespace {

bool is_telemetry(std::span<const std::byte> bytes) noexcept {
  protocol::Header header;
  return !protocol::decode_header(bytes, header) &&
         (header.type == protocol::MessageType::kTicks ||
          header.type == protocol::MessageType::kLocalState);
}

}  // namespace

void ImpairedLink::pump() {
  protocol::Datagram datagram;
  while (outgoing_.take(now_(), datagram))
    link_.send(datagram.peer, protocol::view(datagram.bytes));
  // A pump takes as many as a client at a time; a flood waits in the system's buffer.
  constexpr int kDatagramsPerPump = 256;
  for (int i = 0; i < kDatagramsPerPump && link_.receive(datagram); ++i) hold(incoming_, datagram);
}

bool ImpairedLink::receive(protocol::Datagram& datagram) noexcept {
  pump();
  return incoming_.take(now_(), datagram);
}

void ImpairedLink::send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept {
  hold(outgoing_, {to, {bytes.begin(), bytes.end()}});
  pump();
}

void ImpairedLink::forget(const protocol::Endpoint& peer) noexcept {
  constexpr double kAnyTime = std::numeric_limits<double>::infinity();
  protocol::Datagram datagram;
  while (outgoing_.take(kAnyTime, datagram))
    link_.send(datagram.peer, protocol::view(datagram.bytes));
  link_.forget(peer);
}

void ImpairedLink::hold(protocol::DatagramQueue& queue, const protocol::Datagram& datagram) {
  const double arrival = now_() - datagram.waited;
  if (datagram.dropped || is_telemetry(protocol::view(datagram.bytes))) {
    queue.hold(arrival, datagram);
    return;
  }
  if (conditions_.loss > 0 && uniform(engine_) < conditions_.loss) return;
  queue.hold(arrival + conditions_.delay + conditions_.jitter * uniform(engine_), datagram);
}

}  // namespace hlm
