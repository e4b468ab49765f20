// A recorded stream of contact packets, played into a running server.
#pragma once

#include <cstdint>
#include <functional>

#include "haptic_server/replay/recorded_session.h"
#include "protocol/datagram_link.h"

namespace hlm::server {

struct LiveResult {
  std::uint64_t sent = 0;          ///< Updates.
  std::uint64_t acknowledged = 0;  ///< Of these.
  std::uint64_t incomplete = 0;    ///< Updates that the capture does not hold whole: not sent.
  double round_trip = 0;           ///< Latest, s.
};

struct LiveOptions {
  protocol::Endpoint server;
  double speed = 1;            ///< Times the original pace, > 0.
  double connect_timeout = 5;  ///< s.
};

/// Asks the server for a session with the recorded tool and sends the recorded updates at their
/// pace. `stop` ends it early. Throws std::runtime_error if the server does not answer or refuses.
LiveResult replay_live(const RecordedSession& session, protocol::DatagramLink& link,
                       const LiveOptions& options, const std::function<bool()>& stop);

}  // namespace hlm::server
