#include "hlm/client/own_server.h"

#include <stdexcept>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hlm/protocol/transport/udp_socket.h"

namespace hlm {
namespace {

/// A UDP port of this machine, until it is closed.
class Port {
 public:
  explicit Port(const protocol::Endpoint& at) noexcept
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    if (at.port != 0) {
      const int others_may_ask = 1;
      setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &others_may_ask, sizeof others_may_ask);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(at.address);
    address.sin_port = htons(at.port);
    bound_ = bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~Port() {
    if (socket_ >= 0) close(socket_);
  }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  bool bound() const noexcept { return bound_; }
  protocol::Endpoint endpoint() const noexcept {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    return {ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)};
  }

 private:
  int socket_;
  bool bound_ = false;
};

/// What starts it at a port that is free.
std::vector<std::string> command(const OwnServerOptions& options, const std::string& program,
                                 const protocol::Endpoint& endpoint) {
  std::vector<std::string> arguments{program,
                                     "--listen",
                                     to_string(endpoint),
                                     "--parent",
                                     std::to_string(getpid()),
                                     "--device",
                                     "simulated",
                                     "--device-option",
                                     "friction=0",
                                     "--device-option",
                                     options.planar ? "freedom=planar" : "freedom=spatial",
                                     "--status",
                                     "false",
                                     "--log-level",
                                     "error"};
  if (!options.key_file.empty()) {
    arguments.insert(arguments.end(), {"--key-file", options.key_file});
  }
  if (const char* const file = variable("HAPTIC_RECORD")) {
    arguments.insert(arguments.end(), {"--record", file});
  }
  return arguments;
}

protocol::Endpoint free_endpoint() {
  const Port free({INADDR_LOOPBACK, 0});
  if (!free.bound()) throw std::runtime_error("no port is free for a server");
  return free.endpoint();
}

}  // namespace

std::string usual_server() {
  const char* const named = variable("HAPTIC_SERVER");
  return named != nullptr ? named : "127.0.0.1:47800";
}

bool may_listen(const protocol::Endpoint& server) noexcept { return !Port(server).bound(); }

OwnServer::OwnServer(const OwnServerOptions& options)
    : program_(
          find_program("haptic_server", "HAPTIC_SERVER_PROGRAM", ", or name a server that runs")),
      endpoint_(free_endpoint()),
      running_(command(options, program_, endpoint_)) {}

}  // namespace hlm
