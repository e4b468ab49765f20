#include "tests/system/session.h"

#include <fstream>

namespace hlm::test {

Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Arguments device_of(const std::string& name) {
  const Arguments device{"--device", name};
  return device + (name == "forcedimension" ? Arguments{"--device-option", "watchdog=0.03"}
                                            : Arguments{"--without-time-guard"});
}

std::string loopback(int port) { return "127.0.0.1:" + std::to_string(port); }

Arguments server_command(int port) {
  return {HLM_SERVER, "--listen", loopback(port), "--rate", "500",
          "--status", "false",    "--max-gap",    "1"};
}

Arguments client_command(int port) {
  return {HLM_CLIENT, "--server", loopback(port), "--world", HLM_WORLDS "/testbed.sdf"};
}

Arguments pushing_hand(const TemporaryDirectory& directory, double force) {
  const std::string file = directory.file("push.toml");
  std::ofstream(file) << "[[segment]]\nduration = 3600.0\nwrench = { force = [0, " << force
                      << ", 0] }\n";
  return {"--hand", file};
}

}  // namespace hlm::test
