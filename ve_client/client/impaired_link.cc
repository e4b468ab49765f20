#include "ve_client/client/impaired_link.h"

#include "common/uniform.h"

namespace hlm {

void ImpairedLink::pump() {
  protocol::Datagram datagram;
  while (outgoing_.take(now_(), datagram))
    link_.send(datagram.peer, protocol::view(datagram.bytes));
  // As many as a client takes at a time; a flood waits in the system's buffer.
  constexpr int kMost = 256;
  for (int i = 0; i < kMost && link_.receive(datagram); ++i) hold(incoming_, datagram);
}

bool ImpairedLink::receive(protocol::Datagram& datagram) noexcept {
  pump();
  return incoming_.take(now_(), datagram);
}

void ImpairedLink::send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept {
  hold(outgoing_, {to, {bytes.begin(), bytes.end()}});
  pump();
}

void ImpairedLink::hold(protocol::DatagramQueue& queue, const protocol::Datagram& datagram) {
  if (conditions_.loss > 0 && uniform(engine_) < conditions_.loss) return;
  queue.hold(now_() + conditions_.delay + conditions_.jitter * uniform(engine_), datagram);
}

}  // namespace hlm
