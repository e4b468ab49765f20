#include "hlm/tools/doctor/fault_release.h"

#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/operator_socket.h"
#include "hlm/tools/doctor/run_folder.h"

namespace hlm::server {

std::string release_fault(const RunningServer& server) {
  const std::string who =
      fmt::format("process {}, the server at {},", server.process, server.listen);
  const RunFolder folder(server.folder);
  const RunFolder::Listener listener = folder.listener(server.listen + kOperatorSocketSuffix);
  if (!listener.connection.is_open()) {
    throw std::runtime_error(who +
                             " cannot be told: it stands still, is of an older version, or gone");
  }
  if (!command(listener.connection, kReleaseFault)) {
    throw std::runtime_error(who + " does not answer: it stands still, or is another user's");
  }
  const std::string what =
      server.fault != name_of(Fault::kNone)
          ? "has the fault " + server.fault + ": it"
          : fmt::format("had no fault {:.1f} s ago; one that it has now", server.age);
  return fmt::format("the server at {} {} ends with the next session that a person asks for",
                     server.listen, what);
}

}  // namespace hlm::server
