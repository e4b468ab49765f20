// A haptic_server of a program's own, with a simulated device, where none runs on this machine.
#pragma once

#include <optional>
#include <string>

#include "hlm/client/own_program.h"
#include "hlm/protocol/datagram_link.h"

namespace hlm {

/// "HOST:PORT" of the server for programs that name none: HAPTIC_SERVER, or 127.0.0.1:47800.
std::string usual_server();

/// Whether a server may be there: the port is taken, or the address belongs to another machine.
bool may_listen(const protocol::Endpoint& server) noexcept;

struct OwnServerOptions {
  bool planar = false;  ///< The device moves in the plane, for a planar tool; otherwise in space.
  std::string key_file = {};  ///< Shared with the client; empty: none.
};

/// Runs until this object, the process (even by a crash) or the thread that made it ends; that
/// thread should last. It is a child of the process, which should wait for other children by their
/// ids. Control::X_WTarget moves its hand.
class OwnServer {
 public:
  /// Starts it at a free port of this machine. The program is what HAPTIC_SERVER_PROGRAM names, or
  /// haptic_server next to this library or in PATH; it records to what HAPTIC_RECORD names. Throws
  /// std::runtime_error that says where it was looked for, or why it cannot be started.
  explicit OwnServer(const OwnServerOptions& options = {});
  /// Where it listens.
  const protocol::Endpoint& endpoint() const noexcept { return endpoint_; }
  const std::string& program() const noexcept { return program_; }
  pid_t process() const noexcept { return running_.process(); }
  /// As OwnProgram::status().
  std::optional<int> status() noexcept { return running_.status(); }

 private:
  std::string program_;
  protocol::Endpoint endpoint_;
  OwnProgram running_;  ///< It lets go of the device before it ends.
};

}  // namespace hlm
