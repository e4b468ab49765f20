// Under which names a browser may ask for the live page.
#include "hlm/page/web/host_names.h"

#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

TEST_CASE("A server is asked for by a name of this machine, in whatever case, with its port") {
  const HostNames names("192.168.7.2", 8080);
  CHECK(names.is_host("localhost:8080"));
  CHECK(names.is_host("LocalHost:8080"));
  CHECK(names.is_host("127.0.0.1:8080"));
  CHECK(names.is_host("192.168.7.2:8080"));
  CHECK(names.list() == "localhost:8080, 127.0.0.1:8080, 192.168.7.2:8080");
  const std::string other =
      GENERATE(as<std::string>(), "", "localhost", "localhost:80", "localhost:8080.",
               "evil.example:8080", "192.168.7.3:8080", "localhost:8080 ", "localhost:80800");
  INFO(other);
  CHECK_FALSE(names.is_host(other));
}

TEST_CASE("The port of HTTP is left out, as browsers do") {
  const HostNames names("127.0.0.1", 80);
  CHECK(names.is_host("localhost"));
  CHECK_FALSE(names.is_host("localhost:80"));
  CHECK(names.list() == "localhost, 127.0.0.1");
}

TEST_CASE("A page of this server has an origin of it, over HTTP") {
  const HostNames names("127.0.0.1", 8080);
  CHECK(names.is_origin("http://localhost:8080", "LocalHost:8080"));
  CHECK_FALSE(names.is_origin("http://localhost:8080", "127.0.0.1:8080"));
  CHECK_FALSE(names.is_origin("http://evil.example:8080", "evil.example:8080"));
  const std::string other =
      GENERATE(as<std::string>(), "", "null", "https://localhost:8080", "http://evil.example",
               "http://localhost:8080.evil.example", "http://localhost:8080/", "localhost:8080");
  INFO(other);
  CHECK_FALSE(names.is_origin(other, "localhost:8080"));
}

TEST_CASE("A page of the partner's port is taken, too, under the same name alone") {
  const HostNames names("192.168.7.2", 8080, 8081);
  const std::string host = GENERATE(as<std::string>(), "localhost", "127.0.0.1", "192.168.7.2");
  CAPTURE(host);
  CHECK(names.is_origin("http://" + host + ":8080", host + ":8080"));
  CHECK(names.is_origin("http://" + host + ":8081", host + ":8080"));
  CHECK_FALSE(names.is_host(host + ":8081"));
  CHECK_FALSE(names.is_origin("http://" + host + ":8081", host + ":8081"));
  const std::string other =
      GENERATE(as<std::string>(), "http://evil.example:8081", "https://localhost:8081",
               "http://localhost:8082", "http://localhost", "http://localhost:80810",
               "http://192.168.7.3:8081", "http://localhost:8081/", "localhost:8081", "null", "");
  INFO(other);
  CHECK_FALSE(names.is_origin(other, host + ":8080"));
}

TEST_CASE("Without a partner no other port is taken, and port 80 is left out of a partner's name") {
  CHECK_FALSE(HostNames("127.0.0.1", 8080).is_origin("http://localhost:0", "localhost:8080"));
  CHECK_FALSE(HostNames("127.0.0.1", 8080).is_origin("http://localhost", "localhost:8080"));
  CHECK(HostNames("127.0.0.1", 8080, 80).is_origin("http://localhost", "localhost:8080"));
  CHECK(HostNames("127.0.0.1", 80, 8081).is_origin("http://localhost:8081", "localhost"));
}

}  // namespace
}  // namespace hlm::ve
