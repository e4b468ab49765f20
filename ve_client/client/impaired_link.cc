#include "ve_client/client/impaired_link.h"

#include <algorithm>

namespace hlm {

void ImpairedLink::pump() {
  protocol::Datagram datagram;
  while (take(outgoing_, datagram)) link_.send(datagram.peer, protocol::view(datagram.bytes));
  // As many as a client takes at a time; a flood waits in the system's buffer.
  constexpr int kMost = 256;
  for (int i = 0; i < kMost && link_.receive(datagram); ++i) hold(incoming_, datagram);
}

bool ImpairedLink::receive(protocol::Datagram& datagram) noexcept {
  pump();
  return take(incoming_, datagram);
}

void ImpairedLink::send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept {
  hold(outgoing_, {to, {bytes.begin(), bytes.end()}});
  pump();
}

void ImpairedLink::hold(Queue& queue, const protocol::Datagram& datagram) {
  if (conditions_.loss > 0 && uniform() < conditions_.loss) return;
  const double due = now_() + conditions_.delay + conditions_.jitter * uniform();
  const auto later =
      std::upper_bound(queue.begin(), queue.end(), due,
                       [](double time, const Held& held) { return time < held.due; });
  queue.insert(later, Held{due, datagram});
}

bool ImpairedLink::take(Queue& queue, protocol::Datagram& datagram) {
  if (queue.empty() || queue.front().due > now_()) return false;
  datagram = queue.front().datagram;
  queue.erase(queue.begin());
  return true;
}

double ImpairedLink::uniform() {
  constexpr double kTwoToMinus53 = 0x1.0p-53;
  return static_cast<double>(engine_() >> 11) * kTwoToMinus53;
}

}  // namespace hlm
