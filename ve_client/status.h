// What the client tells its user while it runs: the state of the connection and a status line.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "ve_client/client/haptic_client.h"
#include "ve_client/contacts/manifold.h"
#include "ve_client/frame.h"

namespace hlm::ve {

/// Judges whether the server can still be hoped for.
class Connection {
 public:
  /// `server` is its name in messages; `timeout` (s) holds until the first session, 0: for ever.
  Connection(std::string server, double timeout) : server_(std::move(server)), timeout_(timeout) {}

  /// Logs what changed. Throws std::runtime_error with one line if the server speaks another
  /// version, refuses the tool, or has not granted a session in time. `now`: s since the start.
  void watch(double now, const HapticClient::Inbox& inbox, bool connected);

 private:
  void judge(const protocol::Reject& reject);

  std::string server_;
  double timeout_;
  bool ever_connected_ = false;
  bool busy_ = false;
};

/// The server's refusal of an update, or of one contact of it, in words.
std::string describe(const protocol::Refusal& refusal);

/// Logs one line a second.
class Status {
 public:
  void count(const FrameResult& frame);
  /// `now`: s since the start.
  void report(double now, const HapticClient& client, const ProximityStatistics& proximity);

 private:
  double last_report_ = 0;
  int frames_ = 0;
  std::size_t active_ = 0;     ///< Of the latest frame.
  std::size_t predicted_ = 0;  ///< Of the latest frame.
  std::optional<protocol::Refusal> refusal_;  ///< By the server, since the latest report.
  int refused_ = 0;            ///< Proxy states that could not be followed, since the start.
  int warned_refused_ = 0;     ///< As of the latest report.
  std::uint64_t warned_failures_ = 0;  ///< Of proximity queries, as of the latest report.
};

}  // namespace hlm::ve
