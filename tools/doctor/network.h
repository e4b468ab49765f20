// How is the network to a server?
#pragma once

#include <optional>
#include <string>

#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/sealing/noise.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

struct NetworkOptions {
  std::string name;  ///< Name of the server, for a person.
  protocol::Endpoint server;
  std::optional<protocol::noise::Key> key;  ///< The server's, if it has one.
  double time = 2;                          ///< How long an idle server is measured, s.
};

/// Takes a session of its own, without contacts, from an idle server: round trip, jitter, loss and
/// order come from its updates and their acknowledgements. A fault is left as it is. While another
/// client has the session nothing is sent on this machine, and one question on another.
Examination examine_network(const NetworkOptions& options,
                            const std::optional<RunningServer>& running);

}  // namespace hlm::server
