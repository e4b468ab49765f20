// Who may open the live page of the real ve_client.
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <unistd.h>

#include "tests/page/page_client.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;
using ve::test::HttpClient;
using ve::test::PageAddress;
using ve::test::PageClient;

using Arguments = std::vector<std::string>;

/// ve_client with a page, without a server.
struct Site {
  explicit Site(const std::string& address, const Arguments& more = {})
      : port(static_cast<std::uint16_t>(free_port())) {
    Arguments arguments{HLM_CLIENT,
                        "--server",
                        "127.0.0.1:" + std::to_string(free_port()),
                        "--world",
                        HLM_WORLDS "/testbed.sdf",
                        "--page",
                        address + ":" + std::to_string(port)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    client = std::make_unique<Process>(arguments);
    REQUIRE(client->wait_for_error("live page: http://", 20));
  }

  /// The token in the address that the log shows; empty if there is none.
  std::string token() const {
    const std::string log = client->error();
    const std::size_t at = log.find("/?token=");
    return at == std::string::npos ? "" : log.substr(at + 8, 32);
  }
  /// The address in the log as a terminal takes it: up to the next blank.
  std::string address() const {
    const std::string log = client->error();
    const std::size_t at = log.find("http://");
    return log.substr(at, log.find_first_of(" \n", at) - at);
  }
  unsigned get(const std::string& target) const {
    return ve::test::ask(port, ve::test::get_request(port, target)).status;
  }
  unsigned open(const PageAddress& address) const { return PageClient(port, address).status(); }

  std::uint16_t port;
  std::unique_ptr<Process> client;
};

TEST_CASE("Beyond loopback, and with a key, the page is for those with the token in the log") {
  const TemporaryDirectory directory;
  REQUIRE(run({HLM_KEYGEN, directory.file("key")}).exit_code == 0);
  const bool beyond = GENERATE(true, false);
  const Site site(beyond ? "0.0.0.0" : "127.0.0.1",
                  beyond ? Arguments{} : Arguments{"--key-file", directory.file("key"), "--quiet"});
  const std::string token = site.token();
  CAPTURE(beyond, token, site.client->error());
  REQUIRE(token.size() == 32);
  CHECK(site.address() == "http://127.0.0.1:" + std::to_string(site.port) + "/?token=" + token);
  CHECK(site.get("/?token=" + token) == 200);
  CHECK(site.open({.path = "/session?token=" + token}) == 101);
  const std::string wrong(32, token.front());
  for (const std::string& target :
       {std::string("/"), std::string("/main.js"), "/?token=" + wrong}) {
    CHECK(site.get(target) == 403);
  }
  CHECK(site.open({}) == 403);
  CHECK(site.open({.path = "/session?token=" + wrong}) == 403);
  CHECK(site.open({.origin = "http://evil.example", .path = "/session?token=" + token}) == 403);
  CHECK_THAT(site.client->error(), ContainsSubstring("whoever has this address can move the tool"));
  if (beyond) CHECK_THAT(site.client->error(), ContainsSubstring("nothing is encrypted"));
}

/// What another user of the machine gets, over a socket of this family: the status, and why.
std::string as_nobody(const Site& site, const std::string& target, bool ipv6 = false) {
  const std::string connect =
      ipv6 ? "c.sock = socket.socket(socket.AF_INET6); c.sock.connect(('::ffff:127.0.0.1', p))\n"
           : "";
  return run({"setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups",
              "/usr/bin/python3", "-c",
              "import http.client, socket\np = " + std::to_string(site.port) +
                  "\nc = http.client.HTTPConnection('127.0.0.1', p)\n" + connect +
                  "c.request('GET', '" + target +
                  "')\nr = c.getresponse(); print(r.status, r.read())"})
      .output;
}

TEST_CASE("On loopback the page is for the user who started it, and for no other of the machine") {
  if (geteuid() != 0) {
    WARN("SKIPPED: only root can be another user");
    return;
  }
  const bool ipv6 = GENERATE(false, true);
  {
    const Site site("127.0.0.1");
    CHECK(site.get("/") == 200);
    CHECK(site.open({}) == 101);
    for (const char* target : {"/", "/main.js", "/session", "/recording"}) {
      CHECK_THAT(as_nobody(site, target, ipv6),
                 Catch::Matchers::StartsWith("403") &&
                     ContainsSubstring("this page is for the user who started it"));
    }
  }
  setenv("SUDO_UID", "65534", 1);  // Who has started it by sudo opens it as themselves.
  {
    const Site site("127.0.0.1");
    CHECK_THAT(as_nobody(site, "/", ipv6), Catch::Matchers::StartsWith("200"));
  }
  unsetenv("SUDO_UID");
  const Site insecure("127.0.0.1", {"--insecure"});
  CHECK_THAT(as_nobody(insecure, "/", ipv6), Catch::Matchers::StartsWith("200"));
}

TEST_CASE("An insecure page is served to everyone, and one warning says what that exposes") {
  const Site site("0.0.0.0", {"--insecure"});
  CHECK(site.address() == "http://127.0.0.1:" + std::to_string(site.port));
  CHECK(site.token().empty());
  CHECK(site.get("/") == 200);
  const std::string warning = "whoever reaches 0.0.0.0:" + std::to_string(site.port);
  REQUIRE(site.client->wait_for_error(warning, 10));
  const std::string log = site.client->error();
  CHECK(log.find(warning) == log.rfind(warning));
}

TEST_CASE("On loopback a page of a stranger, or under a stranger's name, gets nothing") {
  const Site site("127.0.0.1");
  const std::string port = std::string(":") + std::to_string(site.port);
  CHECK(site.token().empty());
  CHECK(site.get("/") == 200);
  CHECK(site.open({}) == 101);
  CHECK(site.open({.origin = "http://evil.example"}) == 403);
  CHECK(site.open({.host = "evil.example" + port, .origin = "http://evil.example" + port}) == 403);
  CHECK(site.open({.host = "127.0.0.1" + port, .origin = "http://localhost" + port}) == 403);
}

TEST_CASE("Two hundred requests that stall do not shut the page") {
  const Site site("127.0.0.1");
  std::vector<std::unique_ptr<HttpClient>> stalled;
  for (int i = 0; i < 200; ++i) {
    stalled.push_back(std::make_unique<HttpClient>(site.port));
    stalled.back()->send("GET / HTTP/1.1\r\nHost: ");
  }
  CHECK(site.get("/") == 200);
}

}  // namespace
}  // namespace hlm::test
