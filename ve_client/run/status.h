// What the client tells its user while it runs: the state of the connection and a status line.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

#include "hlm/client/haptic_client.h"
#include "hlm/geometry/manifold.h"
#include "hlm/ve_client/run/frame.h"

namespace hlm::ve {

/// The server has granted no session in the time that the user gave it.
struct NeverAnswered : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Watches whether there is a session, and says what it waits for where there is none: soon,
/// then ever more seldom.
class Connection {
 public:
  /// `server` is its name in messages, `key_file` that of the key in use, empty: none; `timeout`
  /// (s) holds until the first session, 0: for ever. tool_may_change: a page can choose another
  /// scene.
  Connection(std::string server, std::string key_file, double timeout, bool tool_may_change)
      : server_(std::move(server)),
        key_file_(std::move(key_file)),
        timeout_(timeout),
        tool_may_change_(tool_may_change) {}

  /// Logs what changed. Throws std::runtime_error with one line if the server speaks another
  /// version, or refuses a tool that cannot change; NeverAnswered if it has not granted a session
  /// in time. `now`: s since the start.
  void watch(double now, const HapticClient::Inbox& inbox, bool connected);
  /// The run is over. Throws NeverAnswered if there has been no session at all. `now`: s since the
  /// start.
  void end(double now) const;

 private:
  /// A server that runs has answered by then, s.
  static constexpr double kPatience = 0.5;
  static constexpr double kFirstPause = 5;     ///< s.
  static constexpr double kLongestPause = 60;  ///< s.

  /// Why there is no session yet, where there may be one later. Throws where there will be none: a
  /// hello that was damaged on its way gets such an answer too, but not twice in a row.
  std::string judge(const protocol::Reject& reject);
  void say_what_is_awaited(double now);
  [[noreturn]] void give_up(const std::string& when) const;

  /// Why a server may not answer.
  std::string reasons_for_silence() const;

  std::string server_;
  std::string key_file_;
  double timeout_;
  bool tool_may_change_;
  bool ever_connected_ = false;
  std::optional<protocol::RejectReason> latest_reject_;  ///< Since the latest session.
  std::string rejected_;             ///< Why the server gives no session; empty: it has not said.
  double next_message_ = kPatience;  ///< Time of the next message on the wait, s since the start.
  double pause_ = kFirstPause;       ///< Time from that message to the one after, s.
};

/// Warns where the tool moves in directions in which the server's device does not.
void warn_of_mismatch(const ToolAssembly& tool, const protocol::DeviceReport& device);

/// The server's refusal of an update, or of one contact of it, in words.
std::string describe(const protocol::Refusal& refusal);

/// Logs one line a second, and faults of the server as they come.
class Status {
 public:
  /// server: whose lines these are, where there are several; else empty.
  explicit Status(const std::string& server) : prefix_(server.empty() ? "" : server + ": ") {}

  void count(const FrameResult& frame);
  /// `now`: s since the start.
  void report(double now, const HapticClient& client, const ProximityStatistics& proximity);

 private:
  std::string connection(const HapticClient& client) const;

  std::string prefix_;
  Fault fault_ = Fault::kNone;  ///< Fault of the server, in this session.
  double last_report_ = 0;
  int frames_ = 0;
  std::size_t found_ = 0;                     ///< Contacts of the tool, of the latest frame.
  std::size_t active_ = 0;                    ///< Active contacts of the latest frame.
  std::size_t predicted_ = 0;                 ///< Predicted contacts of the latest frame.
  std::optional<protocol::Refusal> refusal_;  ///< Refusal by the server, since the latest report.
  int refused_ = 0;         ///< Proxy states that could not be followed, since the start.
  int warned_refused_ = 0;  ///< Value of refused_ at the latest report.
  std::uint64_t warned_failures_ = 0;  ///< Failed proximity queries, as of the latest report.
};

}  // namespace hlm::ve
