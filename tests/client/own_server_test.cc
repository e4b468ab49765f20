#include "hlm/client/own_server.h"

#include <csignal>
#include <cstdlib>

#include <sys/wait.h>

#include "hlm/client/haptic_client.h"
#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm {
namespace {

using test::wait_until;

bool runs(pid_t process) { return kill(process, 0) == 0; }

/// The program that is tested, and nobody's server at the usual place.
struct Environment {
  Environment() {
    setenv("HAPTIC_SERVER_PROGRAM", HLM_SERVER, 1);
    const protocol::UdpSocket probe(protocol::resolve("127.0.0.1:0", 0));
    setenv("HAPTIC_SERVER", to_string(probe.local()).c_str(), 1);
  }
};

HapticClientOptions planar_ball(const protocol::Endpoint& server) {
  HapticClientOptions options;
  options.server = server;
  options.tool.links.emplace_back().joint = JointType::kPlanar;
  options.q = Configuration::Zero(3);
  return options;
}

TEST_CASE("A server of the program's own serves, says its place, and ends with its owner") {
  const Environment environment;
  CHECK_FALSE(may_listen(protocol::resolve(usual_server())));
  pid_t process = -1;
  {
    OwnServer own({.planar = true});
    process = own.process();
    CHECK(own.program() == HLM_SERVER);
    CHECK(is_loopback(own.endpoint()));
    protocol::UdpSocket socket({});
    HapticClient client(socket, planar_ball(own.endpoint()));
    CHECK(wait_until(10, [&] {
      client.poll(steady_seconds());
      return client.connected();
    }));
    CHECK(may_listen(own.endpoint()));
    CHECK_FALSE(own.status());
    client.close(steady_seconds());
  }
  CHECK_FALSE(runs(process));
}

TEST_CASE("What a server of the program's own ended with is told") {
  const Environment environment;
  OwnServer own;
  kill(own.process(), SIGKILL);
  CHECK(wait_until(10, [&] { return own.status().has_value(); }));
  CHECK(own.status() == 128 + SIGKILL);
}

TEST_CASE("A program that lets the system collect its children ends its server too") {
  const Environment environment;
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  pid_t process = -1;
  {
    const OwnServer own;
    process = own.process();
  }
  std::signal(SIGCHLD, before);
  CHECK_FALSE(runs(process));
}

TEST_CASE("Without a variable, or with an empty one, the usual server is the documented one") {
  setenv("HAPTIC_SERVER", "", 1);
  CHECK(usual_server() == "127.0.0.1:47800");
  unsetenv("HAPTIC_SERVER");
  CHECK(usual_server() == "127.0.0.1:47800");
}

TEST_CASE("Another machine may have a server at the usual place") {
  CHECK(may_listen(protocol::resolve("192.0.2.1:47800")));  // RFC 5737: nobody's.
}

TEST_CASE("Where there is no server to start, the error names the place") {
  setenv("HAPTIC_SERVER_PROGRAM", "/nowhere/server", 1);
  CHECK_THROWS_WITH(
      OwnServer(),
      "there is no haptic_server to start: looked for /nowhere/server. Install it, set "
      "HAPTIC_SERVER_PROGRAM to its file, or name a server that runs");
}

}  // namespace
}  // namespace hlm
