// The server under a service manager.
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <regex>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;

/// The manager's end of the notification protocol.
class Manager {
 public:
  explicit Manager(const std::string& path) : socket_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    REQUIRE(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  }
  ~Manager() { close(socket_); }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  /// What has come until now.
  std::string heard() {
    char text[512];
    ssize_t size = 0;
    while ((size = recv(socket_, text, sizeof text, MSG_DONTWAIT)) > 0) {
      all_.append(text, static_cast<std::size_t>(size)).append("\n");
    }
    return all_;
  }
  bool await(const std::string& text, double timeout) {
    return wait_until(timeout, [&] { return heard().find(text) != std::string::npos; });
  }
  void forget() { all_.clear(); }

 private:
  int socket_;
  std::string all_;
};

TEST_CASE("A service manager hears when the server is ready, that its loop goes on, and its end") {
  const TemporaryDirectory directory;
  Manager manager(directory.file("notify"));
  const int port = free_port();
  Process server(
      Arguments{"env", "NOTIFY_SOCKET=" + directory.file("notify"), "WATCHDOG_USEC=500000"} +
      server_command(port));
  REQUIRE(manager.await("READY=1", 10));
  CHECK_THAT(manager.heard(), ContainsSubstring("STATUS=off"));
  CHECK(manager.await("WATCHDOG=1", 1));
  Process client(client_command(port) + Arguments{"--duration", "30"});
  CHECK(manager.await("STATUS=active", 10));

  SECTION("its end") {
    server.send_signal(SIGTERM);
    CHECK(manager.await("STOPPING=1", 5));
    CHECK(server.wait(10) == 0);
  }
  SECTION("a stop of the loop, by silence") {
    server.send_signal(SIGSTOP);
    manager.heard();
    manager.forget();
    CHECK_FALSE(manager.await("WATCHDOG=1", 1));
    server.send_signal(SIGCONT);
    CHECK(manager.await("WATCHDOG=1", 5));
  }
}

TEST_CASE("Each unit is one that systemd accepts, with little exposure") {
  if (std::system("command -v systemd-analyze >/dev/null") != 0) {
    WARN("SKIPPED: there is no systemd-analyze");
    return;
  }
  const std::string name =
      GENERATE("haptic_server.service", "haptic_server@.service", "ve_client@.service");
  const TemporaryDirectory directory;
  const std::string unit = directory.file(name);
  std::ifstream file(HLM_UNITS "/" + name);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::ofstream(unit) << std::regex_replace(text, std::regex("ExecStart=\\S+"),
                                            std::string("ExecStart=") + HLM_SERVER);
  const Finished verified = run({"systemd-analyze", "verify", "--man=no", unit}, 60);
  INFO(verified.output << verified.error);
  CHECK(verified.exit_code == 0);
  // Of 10. What stays is the network and the clock of real-time threads.
  const Finished exposure = run(
      {"systemd-analyze", "security", "--no-pager", "--offline=true", "--threshold=20", unit}, 60);
  INFO(exposure.output << exposure.error);
  CHECK(exposure.exit_code == 0);
}

TEST_CASE("The rights that the unit grants suffice for real time") {
  const Arguments rights{"prlimit",        "--rtprio=50",         "--memlock=unlimited",
                         "setpriv",        "--reuid=65534",       "--regid=65534",
                         "--clear-groups", "--bounding-set=-all", "--no-new-privs"};
  if (run(rights + Arguments{"true"}).exit_code != 0) {
    WARN("SKIPPED: these rights cannot be granted here (root with CAP_SYS_RESOURCE can)");
    return;
  }
  const Finished server =
      run(rights + server_command(free_port()) +
          Arguments{"--realtime", "require", "--duration", "0.5", "--keep-recordings", "0"});
  INFO(server.error);
  CHECK(server.exit_code == 0);
}

}  // namespace
}  // namespace hlm::test
