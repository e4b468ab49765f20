#include "tests/system/stand_in_session.h"

#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "tests/support/catch.h"

namespace hlm::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

}  // namespace

StandInSession::StandInSession(const std::string& wrench) {
  std::ofstream(file("hand.toml")) << "[[segment]]\nduration = 3600.0\nwrench = " << wrench << '\n';
  std::ofstream(file("orders"));
  setenv("HAPTIC_STAND_IN_HAND", file("hand.toml").c_str(), 1);
  setenv("HAPTIC_STAND_IN_ORDERS", file("orders").c_str(), 1);
  setenv("HAPTIC_STAND_IN_MOTORS", file("motors").c_str(), 1);
}

void StandInSession::serve(const Arguments& options) {
  server_.emplace(Arguments{HLM_SERVER, "--listen", loopback(port_), "--status", "false",
                            "--max-gap", "1", "--keep-recordings", "0"} +
                  options);
  const bool listens = server_->wait_for_error("listening", 10);
  INFO(server_->error());
  REQUIRE(listens);
}

void StandInSession::arm(const Arguments& options) {
  if (server_) server_->send_signal(SIGRTMIN);  // As the person at the device does after a fault.
  client_.reset();
  client_.emplace(client_command(port_) + Arguments{"--duration", "60", "--quiet"} + options);
}

void StandInSession::press(double force, double share) {
  Clock::time_point since = Clock::now();
  const bool rests = wait_until(20, [&] {
    if (!(std::abs(motor() - force) < share * std::abs(force))) since = Clock::now();
    return Clock::now() - since > 200ms;
  });
  INFO(motor() << " N\n" << server_->error());
  REQUIRE(rests);
}

void StandInSession::order(const std::string& line) const {
  std::ofstream(file("orders"), std::ios::app) << line << '\n';
}

double StandInSession::motor() const {
  std::array<double, 6> F{};
  std::ifstream(file("motors"), std::ios::binary).read(reinterpret_cast<char*>(F.data()), sizeof F);
  return F[1];
}

double StandInSession::time_until_off() const {
  const Clock::time_point begin = Clock::now();
  while (motor() != 0 && Clock::now() - begin < 5s) std::this_thread::sleep_for(200us);
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace hlm::test
