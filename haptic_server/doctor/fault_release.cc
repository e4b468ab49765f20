#include "hlm/doctor/fault_release.h"

#include <cerrno>
#include <csignal>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <spdlog/fmt/fmt.h>

#include "hlm/common/vocabulary.h"

namespace hlm::server {
namespace {

/// Whether the process handles the signal. Another program may have got the number of a server that
/// is gone, and a server of an older version would end.
bool catches(pid_t process, int signal) {
  std::ifstream status(fmt::format("/proc/{}/status", process));
  for (std::string line; std::getline(status, line);) {
    if (!line.starts_with("SigCgt:")) continue;
    return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1) != 0;
  }
  return false;
}

}  // namespace

std::string release_fault(const RunningServer& server) {
  const std::string who =
      fmt::format("process {}, the server at {},", server.process, server.listen);
  if (!catches(server.process, SIGRTMIN)) {
    throw std::runtime_error(who + " cannot be told: it is of an older version, or gone");
  }
  if (kill(server.process, SIGRTMIN) != 0) {
    throw std::runtime_error(who + " cannot be told: " + std::generic_category().message(errno));
  }
  const std::string what =
      server.fault != name_of(Fault::kNone)
          ? "has the fault " + server.fault + ": it"
          : fmt::format("had no fault {:.1f} s ago; one that it has now", server.age);
  return fmt::format("the server at {} {} ends with the next session that a person asks for",
                     server.listen, what);
}

}  // namespace hlm::server
