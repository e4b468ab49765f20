// A network made worse on purpose.
#include "hlm/protocol/transport/impaired_link.h"

#include "hlm/protocol/codec.h"
#include "hlm/protocol/transport/memory_network.h"
#include "tests/support/catch.h"

namespace hlm {
namespace {

using protocol::MemoryNetwork;

/// A client behind an impaired link, and the server's end.
struct Setup {
  MemoryNetwork network;
  double now = 0;
  ImpairedLink link{network.client(), [this] { return now; }, 1};

  void pass(double seconds) {
    now += seconds;
    network.set_time(now);
    link.pump();
  }
  int received_by_server() {
    protocol::Datagram datagram;
    int count = 0;
    while (network.server().receive(datagram)) ++count;
    return count;
  }
  void send() {
    const std::array<std::byte, 3> bytes{};
    link.send(MemoryNetwork::kServer, bytes);
  }
};

TEST_CASE("Without conditions datagrams pass at once, both ways") {
  Setup setup;
  setup.send();
  CHECK(setup.received_by_server() == 1);
  const std::array<std::byte, 2> bytes{};
  setup.network.server().send(MemoryNetwork::kClient, bytes);
  protocol::Datagram datagram;
  CHECK(setup.link.receive(datagram));
  CHECK(datagram.bytes.size() == 2);
}

TEST_CASE("How long a datagram has waited is known behind the link too") {
  Setup setup;
  const std::array<std::byte, 2> bytes{};
  setup.network.server().send(MemoryNetwork::kClient, bytes);
  setup.now = 0.015;  // It arrived at 0; only now is the link read.
  setup.network.set_time(setup.now);
  protocol::Datagram datagram;
  REQUIRE(setup.link.receive(datagram));
  CHECK(datagram.waited == Approx(0.015).margin(1e-12));  // s
}

TEST_CASE("What is held leaves before the session's keys are forgotten") {
  struct ForgetfulLink final : protocol::DatagramLink {
    bool receive(protocol::Datagram&) noexcept override { return false; }
    void send(const protocol::Endpoint&, std::span<const std::byte>) noexcept override {
      sent += forgotten ? 0 : 1;
    }
    void forget(const protocol::Endpoint& peer) noexcept override {
      forgotten = peer == MemoryNetwork::kServer;
    }
    int sent = 0;
    bool forgotten = false;
  } below;
  ImpairedLink link{below, [] { return 0.0; }, 1};
  link.set_conditions({.delay = 0.05});
  const std::array<std::byte, 3> bytes{};
  link.send(MemoryNetwork::kServer, bytes);
  link.send(MemoryNetwork::kServer, bytes);
  link.forget(MemoryNetwork::kServer);
  CHECK(below.sent == 2);
  CHECK(below.forgotten);
}

TEST_CASE("A delay holds each datagram that long, both ways") {
  Setup setup;
  setup.link.set_conditions({.delay = 0.05});
  setup.send();
  setup.pass(0.049);
  CHECK(setup.received_by_server() == 0);
  setup.pass(0.002);
  CHECK(setup.received_by_server() == 1);

  const std::array<std::byte, 2> bytes{};
  setup.network.server().send(MemoryNetwork::kClient, bytes);
  setup.pass(0);
  protocol::Datagram datagram;
  setup.pass(0.049);
  CHECK_FALSE(setup.link.receive(datagram));
  setup.pass(0.002);
  CHECK(setup.link.receive(datagram));
}

TEST_CASE("Telemetry passes at once, whatever happens to the rest") {
  Setup setup;
  setup.link.set_conditions({.delay = 0.1, .jitter = 0.04, .loss = 0.5});
  protocol::Ticks ticks;
  ticks.ticks.emplace_back();
  const protocol::DatagramBytes bytes = protocol::encode({.session = 1, .sequence = 1}, ticks);
  for (int i = 0; i < 100; ++i) {
    setup.network.server().send(MemoryNetwork::kClient, protocol::view(bytes));
    setup.pass(0);
    protocol::Datagram datagram;
    CHECK(setup.link.receive(datagram));
  }
}

TEST_CASE("Loss takes the portion that it says") {
  Setup setup;
  setup.link.set_conditions({.loss = 0.3});
  for (int i = 0; i < 2000; ++i) setup.send();
  CHECK(setup.received_by_server() == Approx(1400).margin(80));  // four standard deviations
}

}  // namespace
}  // namespace hlm
