// Sockets in a process that may open no more files. The sanitizers open some themselves: it is
// tested without them.
#include <stdexcept>
#include <string>

#include <sys/resource.h>

#include "hlm/protocol/transport/udp_socket.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

constexpr Endpoint kLoopback{.address = 0x7F000001, .port = 0};

TEST_CASE("A socket for which the process has no descriptor left is refused by name") {
  const UdpSocket before(kLoopback);
  rlimit limit{};
  REQUIRE(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  const rlimit none{.rlim_cur = 0, .rlim_max = limit.rlim_max};
  REQUIRE(setrlimit(RLIMIT_NOFILE, &none) == 0);
  std::string said;
  try {
    const UdpSocket refused(kLoopback);
  } catch (const std::runtime_error& error) {
    said = error.what();
  }
  setrlimit(RLIMIT_NOFILE, &limit);
  CHECK(said == "cannot open UDP socket at 127.0.0.1:0: Too many open files");
}

}  // namespace
}  // namespace hlm::protocol
