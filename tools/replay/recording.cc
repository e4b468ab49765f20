#include "hlm/tools/replay/recording.h"

#include <algorithm>

#include "hlm/protocol/codec.h"

namespace hlm::server {

using protocol::CapturedDatagram;
using protocol::MessageType;
using protocol::view;

std::optional<Recording> Recording::open(const std::filesystem::path& path) {
  protocol::CaptureReader capture(path);
  const auto first = capture.next();
  DeviceNote device;
  if (!first || first->from != first->to || !decode(view(first->bytes), device)) return {};
  return Recording(std::move(capture), device, first->from);
}

bool Recording::next(RecordedTick& tick) {
  tick = {};
  while (const auto datagram = capture_.next()) {
    if (datagram->from != datagram->to) {
      take(*datagram, tick);
    } else if (decode(view(datagram->bytes), tick.note)) {
      // A capture does not know channels.
      const auto& channels = tick.note.received;
      for (std::size_t i = 0; i < std::min(channels.size(), tick.received.size()); ++i) {
        tick.received[i].peer.channel = channels[i];
      }
      return true;
    }
  }
  return false;
}

void Recording::take(const CapturedDatagram& datagram, RecordedTick& tick) {
  if (datagram.to == server_) {
    tick.received.push_back({.peer = datagram.from, .bytes = datagram.bytes});
    return;
  }
  protocol::Header header;
  if (decode_header(view(datagram.bytes), header)) return;
  const std::uint64_t session = header.envelope.session;
  protocol::ProxyState state;
  protocol::Welcome welcome;
  if (header.type == MessageType::kProxyState && !decode(view(datagram.bytes), state)) {
    tick.session = session;
    tick.answers.push_back(state);
  } else if (header.type == MessageType::kWelcome && !decode(view(datagram.bytes), welcome)) {
    // A repeated welcome grants nothing.
    if (std::ranges::find(granted_, session) != granted_.end()) return;
    granted_.push_back(session);
    tick.granted = GrantedSession{session, welcome};
  }
}

}  // namespace hlm::server
