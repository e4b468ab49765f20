// Bodies that the real programs' hand moves, over UDP on loopback: judged from the server's log.
#include <algorithm>
#include <csignal>
#include <fstream>
#include <sstream>

#include "tests/support/catch.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

/// Of a column while force is on, from `begin` to `end` seconds of the session.
double median(const std::string& log, const std::string& column, double begin, double end) {
  std::ifstream file(log);
  std::string line;
  std::getline(file, line);
  std::vector<std::string> names;
  const auto split = [](const std::string& text) {
    std::vector<std::string> cells;
    std::istringstream cells_of(text);
    for (std::string cell; std::getline(cells_of, cell, ',');) cells.push_back(cell);
    return cells;
  };
  names = split(line);
  const auto index_of = [&](const std::string& name) {
    const auto found = std::find(names.begin(), names.end(), name);
    REQUIRE(found != names.end());
    return static_cast<std::size_t>(found - names.begin());
  };
  const std::size_t step = index_of("step");
  const std::size_t state = index_of("server_state");
  const std::size_t wanted = index_of(column);
  std::vector<double> values;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = split(line);
    const double time = std::stod(cells[step]) / 500;  // s, at the rate of server_command()
    if (cells[state] != "active" || time < begin || time > end) continue;
    values.push_back(std::stod(cells[wanted]));
  }
  REQUIRE(values.size() > 250);
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

/// Plays a scene with its own hand for `duration` s; the server logs to `log`.
void play(const std::string& scene, double duration, const Arguments& options,
          const std::string& log) {
  const int port = free_port();
  Process server(server_command(port) + options +
                 Arguments{"--hand", HLM_WORLDS "/hands/" + scene + ".toml", "--log", log});
  REQUIRE(server.wait_for_error("listening", 10));
  const Finished client =
      run({HLM_CLIENT, "--server", loopback(port), "--world", HLM_WORLDS "/" + scene + ".sdf",
           "--duration", std::to_string(duration)},
          60);
  CHECK(client.exit_code == 0);
  server.send_signal(SIGTERM);
  CHECK(server.wait(10) == 0);
}

TEST_CASE("Real programs: a cube that is lifted and held weighs what it weighs") {
  const TemporaryDirectory directory;
  const std::string log = directory.file("ticks.csv");
  play("lift", 7.5, {"--device-option", "freedom=spatial"}, log);
  CHECK(median(log, "env_force_z_N", 5.5, 7) == Approx(-0.3 * 9.81).epsilon(0.03));
}

TEST_CASE("Real programs: a brick that is pushed slides at its friction") {
  const TemporaryDirectory directory;
  const std::string log = directory.file("ticks.csv");
  play("push", 5, {}, log);
  const double friction = 0.4 * 0.3 * 9.81;  // N
  const double felt = -median(log, "env_force_x_N", 2.7, 4.5);
  CHECK(felt > 0.98 * friction);
  CHECK(felt < 1.1 * friction);
}

}  // namespace
}  // namespace hlm::test
