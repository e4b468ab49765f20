// Both sides of the session together: on a bad network in memory, and on real sockets.
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "hlm/protocol/client_session.h"
#include "hlm/protocol/server_session.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

using test::planar_hello;
using test::planar_state;
using test::planar_update;

constexpr Endpoint kLoopback{.address = 0x7F000001, .port = 0};

TEST_CASE("On a network that delays, loses, reorders and duplicates, every update taken is whole") {
  protocol::MemoryNetwork network({.delay = 0.01,
                                   .jitter = 0.02,
                                   .loss = 0.02,
                                   .reordering = 0.1,
                                   .reorder_time = 0.03,
                                   .duplication = 0.1},
                                  test::random_seed());
  ServerSession server(network.server(), {.first_session_id = 5});
  ClientSession client(network.client(),
                       {.server = protocol::MemoryNetwork::kServer, .hello = planar_hello()});
  double latest = 0;
  std::uint64_t latest_step = 0;
  int taken = 0;
  int states = 0;
  for (int step = 1; step <= 20000; ++step) {
    const double now = 0.001 * step;
    network.set_time(now);
    const ServerSession::Inbox request = server.poll(now);
    if (request.hello) server.accept(now, {.servo_rate = 1000, .fingerprint = 0});
    if (request.update) {
      ++taken;
      CHECK(request.update->ve_time > latest);
      latest = request.update->ve_time;
      REQUIRE(request.update->contacts.size() == 30);
      for (const ReportedContact& contact : request.update->contacts) {
        CHECK(contact.p_WC.y() == latest);
      }
      server.acknowledge(now, planar_state(static_cast<std::uint64_t>(step)));
    }
    if (step % 20 != 0) continue;
    const ClientSession::Inbox answer = client.poll(now);
    if (answer.state) {
      ++states;
      CHECK(answer.state->step > latest_step);
      latest_step = answer.state->step;
      CHECK(client.round_trip() >= 0.02);
      CHECK(client.round_trip() <= 0.02 + 2 * (0.02 + 0.03) + 0.02);
    }
    client.send(now, planar_update(30, now));
  }
  CHECK(taken > 300);
  CHECK(states > 300);
  CHECK(server.id() == 5);  // One session throughout.
  CHECK(server.statistics().count(DropReason::kMalformed) == 0);
  CHECK(server.statistics().count(DropReason::kIncomplete) > 0);
}

/// Runs `step` every millisecond until it returns true, for at most five seconds.
template <class Step>
bool happens(Step step) {
  for (int i = 0; i < 5000; ++i) {
    if (step()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

TEST_CASE("A session over real sockets: hello, 64 contacts, acknowledgement, goodbye") {
  UdpSocket server_socket(kLoopback);
  UdpSocket client_socket(kLoopback);
  ServerSession server(server_socket, {.first_session_id = 9});
  ClientSession client(client_socket, {.server = server_socket.local(), .hello = planar_hello()});
  REQUIRE(happens([&] {
    if (server.poll(0).hello) server.accept(0, {.servo_rate = 1000, .fingerprint = 5});
    return client.poll(0).welcomed;
  }));
  CHECK(server.id() == 9);

  const std::uint64_t sequence = client.send(1, planar_update(kMaxContacts));
  REQUIRE(happens([&] {
    const ServerSession::Inbox inbox = server.poll(2);
    return inbox.update && inbox.update->contacts.size() == kMaxContacts;
  }));
  server.acknowledge(2, planar_state());
  REQUIRE(happens([&] {
    const ClientSession::Inbox inbox = client.poll(1.5);
    return inbox.state && inbox.state->acknowledged == sequence;
  }));
  CHECK(client.round_trip() == Approx(0.5).margin(0.1));  // less what it waited

  client.close(3);
  CHECK(happens([&] { return server.poll(3).goodbye; }));
  CHECK(server.statistics().total_dropped() == 0);
}

TEST_CASE("A client finds a server that restarts at the same port") {
  UdpSocket client_socket(kLoopback);
  auto server_socket = std::make_unique<UdpSocket>(kLoopback);
  const Endpoint address = server_socket->local();
  ClientSession client(client_socket, {.server = address, .hello = planar_hello()});
  double now = 0;
  const auto welcomed_by = [&](ServerSession& server) {
    return happens([&] {
      now += 0.01;
      if (server.poll(now).hello) server.accept(now, {.servo_rate = 1000, .fingerprint = 0});
      return client.poll(now).welcomed;
    });
  };
  {
    ServerSession server(*server_socket, {.first_session_id = 1});
    REQUIRE(welcomed_by(server));
  }
  server_socket.reset();
  REQUIRE(happens([&] {
    now += 0.01;
    client.send(now, planar_update(0));
    return client.poll(now).lost;
  }));
  UdpSocket successor_socket(address);
  ServerSession successor(successor_socket, {.first_session_id = 2});
  CHECK(welcomed_by(successor));
  CHECK(successor.id() == 2);
}

}  // namespace
}  // namespace hlm::protocol
