// Two real servers and one client: two hands in one world, on hosts of their own, or where one
// server is killed and comes back. Judged from the other server's log.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <fstream>
#include <memory>
#include <sstream>
#include <thread>

#include "tests/support/catch.h"
#include "tests/system/hosts.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

constexpr double kWeight = 0.35 * 9.81;  // N, of the block
constexpr double kRate = 500;            // Hz, of server_command()

/// A tick while force is on.
struct Tick {
  double time = 0;  ///< s of the session.
  double env_z = 0;
  double command_x = 0, command_y = 0, command_z = 0;  ///< N.
};

std::vector<Tick> read_ticks(const std::string& log) {
  std::ifstream file(log);
  std::string line;
  std::getline(file, line);
  const auto split = [](const std::string& text) {
    std::vector<std::string> cells;
    std::istringstream cells_of(text);
    for (std::string cell; std::getline(cells_of, cell, ',');) cells.push_back(cell);
    return cells;
  };
  const std::vector<std::string> names = split(line);
  const auto index_of = [&](const std::string& name) {
    const auto found = std::find(names.begin(), names.end(), name);
    INFO("column " << name);
    REQUIRE(found != names.end());
    return static_cast<std::size_t>(found - names.begin());
  };
  const std::size_t step = index_of("step");
  const std::size_t state = index_of("server_state");
  const std::size_t env_z = index_of("env_force_z_N");
  const std::size_t x = index_of("command_force_x_N");
  const std::size_t y = index_of("command_force_y_N");
  const std::size_t z = index_of("command_force_z_N");
  std::vector<Tick> ticks;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = split(line);
    if (cells[state] != "active") continue;
    ticks.push_back({std::stod(cells[step]) / kRate, std::stod(cells[env_z]), std::stod(cells[x]),
                     std::stod(cells[y]), std::stod(cells[z])});
  }
  return ticks;
}

/// N: median of what the hand bears from `begin` to `end`, s of the session.
double borne(const std::vector<Tick>& ticks, double begin, double end) {
  std::vector<double> forces;
  for (const Tick& tick : ticks) {
    if (tick.time > begin && tick.time < end) forces.push_back(-tick.env_z);
  }
  REQUIRE(forces.size() > 100);
  std::nth_element(forces.begin(), forces.begin() + forces.size() / 2, forces.end());
  return forces[forces.size() / 2];
}

/// N: largest change of the command from tick to tick from `begin` on.
double largest_step(const std::vector<Tick>& ticks, double begin) {
  double largest = 0;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const Tick& a = ticks[i - 1];
    const Tick& b = ticks[i];
    if (b.time < begin || b.time - a.time > 1.5 / kRate) continue;
    largest = std::max(largest, std::hypot(b.command_x - a.command_x, b.command_y - a.command_y,
                                           b.command_z - a.command_z));
  }
  return largest;
}

Arguments hand(const TemporaryDirectory& directory, const std::string& name,
               const std::string& segments) {
  std::ofstream(directory.file(name))
      << "after = \"hold\"\n[grip]\nstiffness = 600\ndamping = 40\nangular_stiffness = 6.0\n"
         "angular_damping = 0.2\nmax_force = 11\nmax_torque = 0.55\n"
      << segments;
  return {"--hand", directory.file(name), "--device-option", "freedom=spatial"};
}

std::string move(double seconds, double z) {
  return "[[segment]]\nduration = " + std::to_string(seconds) + "\nmove_to = { position = [0, 0, " +
         std::to_string(z) + "], rotation = [0, 0, 0] }\n";
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (auto at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST_CASE("Two servers, one client: a killed server ends its hand's push, the other hand goes on") {
  const TemporaryDirectory directory;
  const int port = free_port();
  const int second_port = free_port();
  const std::string log = directory.file("ticks.csv");
  // A loaded machine shall not make the hands let go.
  const Arguments patient{"--silence-time", "1"};
  const Arguments second = server_command(second_port) + patient +
                           hand(directory, "peg.toml", move(2.0, 0.21) + move(1.5, 0.13));
  Process tray(server_command(port) + patient + Arguments{"--log", log} +
               hand(directory, "tray.toml", move(0.5, 0.053) + move(1.2, 0.1)));
  auto peg = std::make_unique<Process>(second);
  REQUIRE(tray.wait_for_error("listening", 10));
  REQUIRE(peg->wait_for_error("listening", 10));

  Process client({HLM_CLIENT, "--server", loopback(port), "--second-server", loopback(second_port),
                  "--world", HLM_WORLDS "/bimanual.sdf"});
  const std::string began = "session with " + loopback(second_port) + " began";
  REQUIRE(client.wait_for_error(began, 10));
  const auto play = [](double seconds) {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  };
  play(6);  // The peg presses on the block.
  peg->send_signal(SIGKILL);
  CHECK(peg->wait(5) == 128 + SIGKILL);
  play(2.5);  // The block is the tray's alone.
  peg = std::make_unique<Process>(second);
  CHECK(wait_until(10, [&] { return count(client.error(), began) == 2; }));

  client.send_signal(SIGTERM);
  CHECK(client.wait(10) == 0);
  tray.send_signal(SIGTERM);
  CHECK(tray.wait(10) == 0);
  const std::vector<Tick> ticks = read_ticks(log);
  const double pushed = borne(ticks, 4.5, 5.7) - kWeight;
  INFO("pushed with " << pushed << " N");
  CHECK(pushed > 0.5);
  CHECK(borne(ticks, 7.2, 8) == Approx(kWeight).epsilon(0.03));
  // The limiter would let the command change by 24 N in a tick.
  CHECK(largest_step(ticks, 5) < 3);
}

TEST_CASE("Two servers on hosts of their own, one client on a third: the tray bears the block") {
  const Hosts hosts(2);
  if (!hosts.made()) {
    WARN("SKIPPED: network namespaces need root (CAP_SYS_ADMIN) and iproute2");
    return;
  }
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  const std::string log = directory.file("ticks.csv");
  const auto on = [](const std::string& host) { return Arguments{"ip", "netns", "exec", host}; };
  const auto server = [&](int i) {
    return on(hosts.server(i)) +
           Arguments{HLM_SERVER, "--listen", "0.0.0.0:47800", "--key-file", key,
                     "--rate",   "500",      "--max-gap",     "5",          "--silence-time",
                     "1",        "--status", "false"};
  };
  Process tray(server(0) + Arguments{"--log", log} +
               hand(directory, "tray.toml", move(0.5, 0.053) + move(1.2, 0.1)));
  Process peg(server(1) + hand(directory, "peg.toml", move(1, 0.21)));
  REQUIRE(tray.wait_for_error("listening", 10));
  REQUIRE(peg.wait_for_error("listening", 10));
  const Finished client =
      run(on(hosts.client()) + Arguments{HLM_CLIENT, "--server", Hosts::address(0) + ":47800",
                                         "--second-server", Hosts::address(1) + ":47800",
                                         "--key-file", key, "--world", HLM_WORLDS "/bimanual.sdf",
                                         "--duration", "5"});
  INFO(client.error);
  CHECK(client.exit_code == 0);
  CHECK(peg.error().find("begins") != std::string::npos);
  tray.send_signal(SIGTERM);
  CHECK(tray.wait(10) == 0);
  CHECK(borne(read_ticks(log), 3, 4.5) == Approx(kWeight).epsilon(0.03));
}

}  // namespace
}  // namespace hlm::test
