// What a person at this machine says to the server, through a socket beside its state file.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "hlm/common/descriptor.h"

namespace hlm::server {

/// ADDRESS:PORT and this is the socket's name in the server's run folder.
inline constexpr const char* kOperatorSocketSuffix = ".sock";
/// What haptic_doctor clear writes, and the answer.
inline constexpr const char* kReleaseFault = "clear\n";
inline constexpr const char* kDone = "done\n";

/// Where `name` in an open folder is: a path that fits an address of a socket however deep the
/// folder lies, and that leads into this very folder.
std::string path_in(const Descriptor& folder, const std::string& name);

/// Takes commands from root and from the server's own user, whom the kernel names (SO_PEERCRED);
/// whoever else connects learns who listens, and no more. A thread of its own does it. Where there
/// can be no socket, a warning says so, and haptic_doctor does not find the server.
class OperatorSocket {
 public:
  /// directory: of the state file; empty: no socket. listen: where the server does, ADDRESS:PORT.
  /// release_fault: called in the socket's thread.
  OperatorSocket(const std::filesystem::path& directory, const std::string& listen,
                 std::function<void()> release_fault);
  ~OperatorSocket();
  OperatorSocket(const OperatorSocket&) = delete;
  OperatorSocket& operator=(const OperatorSocket&) = delete;

 private:
  void serve();
  void answer(const Descriptor& person);

  Descriptor folder_;
  std::string name_;
  Descriptor listener_;
  std::function<void()> release_fault_;
  std::thread thread_;
};

}  // namespace hlm::server
