// A haptic_server of a program's own, with a simulated device, where none runs on this machine.
#pragma once

#include <optional>
#include <string>

#include <sys/types.h>

#include "hlm/protocol/datagram_link.h"

namespace hlm {

/// "HOST:PORT" of the server for programs that name none: HAPTIC_SERVER, or 127.0.0.1:47800.
std::string usual_server();

/// Whether a server may be there: the port is taken, or the address is not of this machine.
bool may_listen(const protocol::Endpoint& server) noexcept;

struct OwnServerOptions {
  bool planar = false;  ///< The device moves in the plane, for a planar tool; otherwise in space.
  std::string key_file = {};  ///< Shared with the client; empty: none.
};

/// Runs until this object ends, or the program, however that is; or the thread that made it, which
/// should last. A child of the program, which should wait for others by their ids. Its hand is
/// Control::X_WTarget.
class OwnServer {
 public:
  /// Starts it at a free port of this machine. The program is what HAPTIC_SERVER_PROGRAM names, or
  /// haptic_server next to this library or in PATH. Throws std::runtime_error that says where it
  /// was looked for, or why it cannot be started.
  explicit OwnServer(const OwnServerOptions& options = {});
  /// Waits up to 2 s until it has let go of the device.
  ~OwnServer();
  OwnServer(const OwnServer&) = delete;
  OwnServer& operator=(const OwnServer&) = delete;

  /// Where it listens.
  const protocol::Endpoint& endpoint() const noexcept { return endpoint_; }
  const std::string& program() const noexcept { return program_; }
  pid_t process() const noexcept { return process_; }
  /// Where the program, or the system for it, has waited for it elsewhere.
  static constexpr int kUnknown = -1;
  /// What it ended with, 128 + the signal that ended it, or kUnknown; empty while it runs.
  std::optional<int> status() noexcept;

 private:
  std::string program_;
  protocol::Endpoint endpoint_;
  pid_t process_ = -1;
  std::optional<int> status_;
};

}  // namespace hlm
