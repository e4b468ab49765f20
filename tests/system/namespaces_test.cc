// Server and client on two hosts: network namespaces joined by a virtual cable.
#include <cstdlib>
#include <string>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

bool ip(const std::string& arguments) {
  return std::system(("ip " + arguments + " >/dev/null 2>&1").c_str()) == 0;
}

/// Two namespaces, 10.77.0.1 and 10.77.0.2, that see nothing but each other. They go with it.
class TwoHosts {
 public:
  TwoHosts() : name_("haptic" + std::to_string(getpid())) {
    made_ = ip("netns add " + server()) && ip("netns add " + client()) &&
            ip("link add " + name_ + "s netns " + server() + " type veth peer name " + name_ +
               "c netns " + client()) &&
            ip("-n " + server() + " address add 10.77.0.1/24 dev " + name_ + "s") &&
            ip("-n " + client() + " address add 10.77.0.2/24 dev " + name_ + "c") &&
            ip("-n " + server() + " link set " + name_ + "s up") &&
            ip("-n " + client() + " link set " + name_ + "c up");
  }
  ~TwoHosts() {
    ip("netns delete " + server());
    ip("netns delete " + client());
  }
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  bool made() const { return made_; }
  std::string server() const { return name_ + "s"; }
  std::string client() const { return name_ + "c"; }

 private:
  std::string name_;
  bool made_ = false;
};

TEST_CASE("Server and client work on two hosts") {
  const TwoHosts hosts;
  if (!hosts.made()) {
    WARN("SKIPPED: network namespaces need root (CAP_SYS_ADMIN) and iproute2");
    return;
  }
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  Process server({"ip", "netns", "exec", hosts.server(), HLM_SERVER, "--listen", "0.0.0.0:47800",
                  "--key-file", key, "--rate", "500", "--max-gap", "5", "--status", "false"});
  REQUIRE(server.wait_for_error("listening", 10));
  const Finished client =
      run({"ip", "netns", "exec", hosts.client(), HLM_CLIENT, "--server", "10.77.0.1:47800",
           "--key-file", key, "--world", HLM_WORLDS "/testbed.sdf", "--duration", "2"});
  INFO(client.error);
  CHECK(client.exit_code == 0);
  CHECK(server.error().find("begins") != std::string::npos);
}

}  // namespace
}  // namespace hlm::test
