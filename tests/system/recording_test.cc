// The flight recorder of the real server.
#include <csignal>

#include "hlm/common/settings/directories.h"
#include "tests/support/catch.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;

TEST_CASE("SIGUSR1 has the last ticks written as a log that the plot script draws") {
  const TemporaryDirectory directory;
  const int port = free_port();
  Process server(server_command(port) + pushing_hand(directory, 2) +
                 Arguments{"--recordings", directory.file("recordings")});
  REQUIRE(server.wait_for_error("listening", 10));
  Process client(client_command(port) + Arguments{"--duration", "30"});
  REQUIRE(server.wait_for_error("begins", 10));
  wait_until(1, [] { return false; });
  server.send_signal(SIGUSR1);
  REQUIRE(server.wait_for_error("recording " + directory.file("recordings"), 10));
  CHECK(server.running());
  const auto files = settings::find_recordings(directory.file("recordings"));
  REQUIRE(files.size() == 1);
  CHECK_THAT(files.front().string(), ContainsSubstring("-request.csv"));
  const Finished plot = run({HLM_PLOT, files.front(), directory.file("picture.png")}, 60);
  INFO(plot.output << plot.error);
  CHECK(plot.exit_code == 0);

  server.send_signal(SIGTERM);
  CHECK(server.wait(10) == 0);
  CHECK_THAT(server.output(), ContainsSubstring(" 0 not recorded"));
}

TEST_CASE("A fault has the ticks before it written") {
  const TemporaryDirectory directory;
  const int port = free_port();
  Process server(server_command(port) +
                 Arguments{"--recordings", directory.file("recordings"), "--max-gap", "0.2"});
  REQUIRE(server.wait_for_error("listening", 10));
  Process client(client_command(port) + Arguments{"--duration", "30"});
  REQUIRE(server.wait_for_error("begins", 10));
  server.send_signal(SIGSTOP);
  wait_until(0.5, [] { return false; });
  server.send_signal(SIGCONT);
  REQUIRE(server.wait_for_error("-overrun.csv", 10));
}

TEST_CASE("A recording that cannot be written whole is reported and leaves nothing behind") {
  const TemporaryDirectory directory;
  const int port = free_port();
  Process server(Arguments{"prlimit", "--fsize=20000"} + server_command(port) +
                 Arguments{"--recordings", directory.file("recordings")});
  REQUIRE(server.wait_for_error("listening", 10));
  server.send_signal(SIGUSR1);
  REQUIRE(server.wait_for_error("cannot be written: File too large; the session goes on", 10));
  CHECK(std::filesystem::is_empty(directory.file("recordings")));
  server.send_signal(SIGTERM);
  CHECK(server.wait(10) == 0);
}

}  // namespace
}  // namespace hlm::test
