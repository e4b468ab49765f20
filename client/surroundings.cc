#include "hlm/client/surroundings.h"

#include "hlm/client/own_server.h"
#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm {
namespace {

class RealSurroundings final : public Surroundings {
 public:
  explicit RealSurroundings(const std::string& address)
      : server_(protocol::resolve(address)), socket_({}) {}

  double begin_frame() override { return now(); }
  double now() override { return steady_seconds(); }
  protocol::DatagramLink& link() override { return socket_; }
  protocol::Endpoint server() const override { return server_; }
  std::string name() const override { return to_string(server_); }
  bool may_have_server() const override { return may_listen(server_); }

 private:
  protocol::Endpoint server_;
  protocol::UdpSocket socket_;
};

}  // namespace

std::unique_ptr<Surroundings> real_surroundings(const std::string& address) {
  return std::make_unique<RealSurroundings>(address);
}

}  // namespace hlm
