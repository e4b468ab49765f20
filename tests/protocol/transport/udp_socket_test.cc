// The UDP socket on loopback, and the names of endpoints.
#include "hlm/protocol/transport/udp_socket.h"

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::protocol {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr Endpoint kLoopback{.address = 0x7F000001, .port = 0};

/// Waits up to five seconds for a datagram.
bool receive_soon(UdpSocket& socket, Datagram& datagram) {
  for (int i = 0; i < 5000; ++i) {
    if (socket.receive(datagram)) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

TEST_CASE("A datagram arrives with its bytes and its sender") {
  UdpSocket a(kLoopback);
  UdpSocket b(kLoopback);
  CHECK(a.local().port != 0);
  Datagram datagram;
  CHECK_FALSE(b.receive(datagram));
  const DatagramBytes sent(1200, std::byte{0xA5});
  a.send(b.local(), view(sent));
  REQUIRE(receive_soon(b, datagram));
  CHECK(datagram.bytes == sent);
  CHECK(datagram.peer == a.local());
  CHECK_FALSE(b.receive(datagram));
}

TEST_CASE("What is asked at one of several addresses is answered from there") {
  UdpSocket server({.address = 0, .port = 0});
  const std::uint32_t asked = GENERATE(0x7F000001U, 0x7F000002U);
  UdpSocket client({.address = 0, .port = 0});  // Its own address is the kernel's choice.
  const Endpoint address{.address = asked, .port = server.local().port};
  const DatagramBytes bytes(10, std::byte{1});
  client.send(address, view(bytes));
  Datagram datagram;
  REQUIRE(receive_soon(server, datagram));
  server.send(datagram.peer, view(bytes));
  REQUIRE(receive_soon(client, datagram));
  CHECK(datagram.peer == address);
}

TEST_CASE("A datagram says how long it has waited since it arrived") {
  UdpSocket a(kLoopback);
  UdpSocket b(kLoopback);
  const DatagramBytes sent(10, std::byte{1});
  a.send(b.local(), view(sent));
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  Datagram datagram;
  REQUIRE(receive_soon(b, datagram));
  CHECK(datagram.waited >= 0.045);  // s
  CHECK(datagram.waited < 1);
}

TEST_CASE("A datagram longer than allowed is consumed and has no bytes") {
  UdpSocket a(kLoopback);
  UdpSocket b(kLoopback);
  const std::vector<std::byte> too_long(1201);
  a.send(b.local(), too_long);
  Datagram datagram;
  datagram.bytes.resize(5);
  REQUIRE(receive_soon(b, datagram));
  CHECK(datagram.bytes.empty());
  CHECK_FALSE(b.receive(datagram));
}

TEST_CASE("A peer that is gone disturbs neither sending nor receiving") {
  UdpSocket a(kLoopback);
  const Endpoint gone = UdpSocket(kLoopback).local();
  const DatagramBytes bytes(10, std::byte{1});
  for (int i = 0; i < 3; ++i) a.send(gone, view(bytes));
  UdpSocket b(kLoopback);
  b.send(a.local(), view(bytes));
  Datagram datagram;
  CHECK(receive_soon(a, datagram));
  CHECK(datagram.peer == b.local());
}

TEST_CASE("Sending and receiving allocate nothing") {
  UdpSocket a(kLoopback);
  UdpSocket b(kLoopback);
  const DatagramBytes bytes(100, std::byte{1});
  Datagram datagram;
  const test::NoMalloc guard;
  for (int i = 0; i < 10; ++i) {
    a.send(b.local(), view(bytes));
    b.receive(datagram);
    b.receive(datagram);
  }
  const std::size_t allocations = guard.allocations();
  CHECK(allocations == 0);
}

TEST_CASE("An address in use or of another machine is refused by name") {
  const UdpSocket first(kLoopback);
  CHECK_THROWS_WITH(UdpSocket(first.local()), ContainsSubstring(to_string(first.local())));
  CHECK_THROWS_WITH(UdpSocket({.address = 0xC0000201, .port = 47800}),
                    ContainsSubstring("192.0.2.1:47800"));
}

TEST_CASE("HOST:PORT names an endpoint") {
  CHECK(resolve("127.0.0.1:47800") == Endpoint{0x7F000001, 47800});
  CHECK(resolve("localhost:1").address == 0x7F000001);
  CHECK(resolve("0.0.0.0:0", 0) == Endpoint{0, 0});
  CHECK(to_string(Endpoint{0x0A0000FE, 65535}) == "10.0.0.254:65535");
}

TEST_CASE("What does not name an endpoint is refused with what is allowed") {
  for (const char* text : {"", "127.0.0.1", ":47800", "127.0.0.1:"}) {
    CHECK_THROWS_WITH(resolve(text), ContainsSubstring("HOST:PORT"));
  }
  for (const char* port : {"0", "65536", "-1", "47800x", "99999999999", " 1"}) {
    CHECK_THROWS_WITH(resolve(std::string("127.0.0.1:") + port),
                      ContainsSubstring("1 to 65535") && ContainsSubstring(port));
  }
  CHECK_THROWS_WITH(resolve("127.0.0.1:65536", 0), ContainsSubstring("0 to 65535"));
  CHECK_THROWS_WITH(resolve("no-such-host.invalid:1"), ContainsSubstring("no-such-host.invalid"));
}

}  // namespace
}  // namespace hlm::protocol
