// Server and client on two hosts.
#include <string>

#include "tests/support/catch.h"
#include "tests/system/hosts.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

TEST_CASE("Server and client work on two hosts") {
  const Hosts hosts(1);
  if (!hosts.made()) {
    WARN("SKIPPED: network namespaces need root (CAP_SYS_ADMIN) and iproute2");
    return;
  }
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  Process server({"ip", "netns", "exec", hosts.server(0), HLM_SERVER, "--listen", "0.0.0.0:47800",
                  "--key-file", key, "--rate", "500", "--max-gap", "5", "--status", "false"});
  REQUIRE(server.wait_for_error("listening", 10));
  const Finished client = run({"ip", "netns", "exec", hosts.client(), HLM_CLIENT, "--server",
                               Hosts::address(0) + ":47800", "--key-file", key, "--world",
                               HLM_WORLDS "/testbed.sdf", "--duration", "2"});
  INFO(client.error);
  CHECK(client.exit_code == 0);
  CHECK(server.error().find("begins") != std::string::npos);
}

}  // namespace
}  // namespace hlm::test
