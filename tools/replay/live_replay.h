// A recorded stream of contact packets, played into a running server.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "hlm/haptic_server/report/drift.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/tools/replay/recorded_session.h"

namespace hlm::server {

struct LiveResult {
  std::uint64_t sent = 0;          ///< Updates.
  std::uint64_t acknowledged = 0;  ///< Updates of these that were acknowledged.
  std::uint64_t incomplete = 0;    ///< Updates that the capture does not hold whole: not sent.
  double round_trip = 0;           ///< Latest, s.
  bool lost = false;           ///< The server ended the session or fell silent; no more was sent.
  std::uint64_t compared = 0;  ///< Acknowledged updates whose recorded answer is known.
  DriftRecord proxy;           ///< Hand frame of the proxy: as recorded against as answered now.
  /// Largest difference between the steps that adopted an update then and now: a server that
  /// missed periods, or updates that came at another pace.
  std::uint64_t steps_apart = 0;
  std::uint64_t other_scene = 0;  ///< Compared answers from another scene than then.
  std::string scene_fault = {};   ///< Why the server has not the scenes; empty if nothing is wrong.
};

struct LiveOptions {
  protocol::Endpoint server;
  double speed = 1;            ///< Times the original pace, > 0.
  double connect_timeout = 5;  ///< s.
};

/// Asks the server for a session with the recorded tool, sends the recorded updates and the scene
/// stream at their pace and compares the answers. The controls of a live page are not sent.
/// `welcomed` is called when the session begins; `stop` ends it early. Throws std::runtime_error if
/// the server does not answer or refuses.
LiveResult replay_live(const RecordedSession& session, protocol::DatagramLink& link,
                       const LiveOptions& options,
                       const std::function<void(const protocol::Welcome&)>& welcomed,
                       const std::function<bool()>& stop);

}  // namespace hlm::server
