// The list of all servers of a machine.
#include "hlm/tools/doctor/server_list.h"

#include <sstream>

#include <nlohmann/json.hpp>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

RunningServer server(const std::string& listen) {
  RunningServer server;
  server.listen = listen;
  server.state = "active";
  server.fault = "none";
  server.client = "192.168.100.200:65535";
  server.lateness_p50 = 2.5e-6;
  server.lateness_max = 0.0123;
  server.load = 0.125;
  server.overruns = 42;
  return server;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST_CASE("Every server has one line, and its numbers stand below their names") {
  RunningServer faulty = server("192.168.100.200:47899");
  faulty.fault = "operator_stop";
  RunningServer hung = server("127.0.0.1:47801");
  hung.age = 17.3;
  hung.client.clear();
  const auto lines = lines_of(list_as_text({server("127.0.0.1:47800"), hung, faulty}));
  REQUIRE(lines.size() == 5);
  for (std::size_t i = 0; i < 4; ++i) CHECK(lines[i].size() == lines[0].size());
  const std::size_t state = lines[0].find("state");
  CHECK(lines[1].substr(state, 6) == "active");
  CHECK(lines[2].substr(state, 17) == "stands still 17 s");
  CHECK(lines[3].substr(state, 19) == "fault operator_stop");
  CHECK(lines[1].ends_with("       2.5     12300.0    0.12        42"));
  CHECK_THAT(lines[2], ContainsSubstring("none"));
}

TEST_CASE("Where no server runs, the list says so") {
  CHECK_THAT(list_as_text({}), ContainsSubstring("No haptic_server runs on this machine"));
  CHECK(nlohmann::json::parse(list_as_json({})).at("servers").empty());
}

TEST_CASE("The list as JSON has the same, in seconds") {
  const auto report = nlohmann::json::parse(list_as_json({server("127.0.0.1:47800")}));
  const auto& only = report.at("servers").at(0);
  CHECK(only.at("listen") == "127.0.0.1:47800");
  CHECK(only.at("client") == "192.168.100.200:65535");
  CHECK(only.at("lateness_max") == 0.0123);
  CHECK(only.at("load") == 0.125);
  CHECK(only.at("missed") == 42);
}

}  // namespace
}  // namespace hlm::server
