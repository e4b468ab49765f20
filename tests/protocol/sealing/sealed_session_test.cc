// Sessions over sealed datagrams: who gets the server, and when.
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "hlm/protocol/client_session.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/sealing/sealed_server_link.h"
#include "hlm/protocol/server_session.h"
#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr double kTimeout = 0.5;  // s, of the server
constexpr double kStep = 0.01;    // s

/// A client with its own address; without a key where there is none.
struct Client {
  Client(const double& now, std::uint16_t port, const std::optional<noise::Key>& key)
      : address{.address = 0x0A000002, .port = port} {
    if (key) sealed.emplace(wire, kServer, *key, [&now] { return now; });
    ClientSessionOptions options{.server = kServer, .hello = test::planar_hello()};
    options.hello.nonce = 0;
    session.emplace(sealed ? static_cast<DatagramLink&>(*sealed) : wire, options);
  }

  /// A frame: what came, and an update if there is a session.
  void frame(double now) {
    const ClientSession::Inbox inbox = session->poll(now);
    if (inbox.reject) reason = inbox.reject->reason;
    session->send(now, test::planar_update(4));
  }

  Endpoint address;
  test::QueueLink wire;
  std::optional<SealedClientLink> sealed;
  std::optional<ClientSession> session;
  std::optional<RejectReason> reason;  ///< Of the latest reject.
};

struct World {
  Client& add(const std::optional<noise::Key>& with) {
    clients.push_back(
        std::make_unique<Client>(now, static_cast<std::uint16_t>(50000 + clients.size()), with));
    return *clients.back();
  }
  void stop(const Client& client) {
    std::erase_if(clients, [&](const auto& one) { return one.get() == &client; });
  }
  /// Until then all clients make frames, the server grants what is asked for.
  void run(double seconds) {
    for (const double end = now + seconds; now < end; now += kStep) {
      for (const auto& client : clients) {
        client->frame(now);
        for (const Datagram& datagram : client->wire.sent()) {
          wire.deliver(client->address, datagram.bytes);
          note(datagram.bytes);
        }
        client->wire.forget_sent();
      }
      const ServerSession::Inbox inbox = server.poll(now);
      if (inbox.hello) server.accept(now, {.servo_rate = 1000});
      if (inbox.update) {
        server.acknowledge(now, test::planar_state());
        ++updates;
      }
      for (const Datagram& datagram : wire.sent()) {
        for (const auto& client : clients) {
          if (client->address == datagram.peer) client->wire.deliver(kServer, datagram.bytes);
        }
      }
      wire.forget_sent();
    }
  }

  void note(const DatagramBytes& packet) {
    const PacketKind kind = kind_of(view(packet));
    if (kind.error || kind.type != PacketType::kSealed) return;
    latest_sealed = packet;
    channels.insert(receiver_of(view(packet)));
  }

  double now = 0;
  noise::Key key = noise::random_key_pair().secret_key;
  test::QueueLink wire;
  SealedServerLink sealed{wire, key, [this] { return now; }};
  ServerSession server{sealed, {.timeout = kTimeout}};
  std::vector<std::unique_ptr<Client>> clients;
  int updates = 0;
  DatagramBytes latest_sealed;      ///< From a client.
  std::set<ChannelIndex> channels;  ///< To which clients have spoken.
};

TEST_CASE("A client with the key is in session within 0.2 s, and its updates are acknowledged") {
  World world;
  const Client& client = world.add(world.key);
  world.run(0.2);
  CHECK(client.session->active());
  world.updates = 0;
  world.run(1);
  CHECK(world.updates == 100);
  CHECK(world.server.statistics().total_dropped() == 0);
  CHECK(client.session->statistics().total_dropped() == 0);
}

TEST_CASE("A second client with the key is told that the server is busy, the first goes on") {
  World world;
  const Client& first = world.add(world.key);
  world.run(0.3);
  const std::uint64_t id = world.server.id();
  const Client& second = world.add(world.key);
  const Client& third = world.add(world.key);
  world.run(3);
  CHECK(first.session->active());
  CHECK(world.server.id() == id);
  CHECK(second.reason == RejectReason::kBusy);
  CHECK(third.reason == RejectReason::kBusy);
}

TEST_CASE("A dead client's session is taken over after the timeout, by whoever holds the key") {
  World world;
  const Client& first = world.add(world.key);
  world.run(0.3);
  world.stop(first);
  world.add(std::nullopt);
  world.add(noise::random_key_pair().secret_key);
  const std::uint64_t id = world.server.id();
  world.run(2);
  CHECK(world.server.id() == id);  // nobody without it

  const Client& heir = world.add(world.key);
  world.run(0.3);
  CHECK(heir.session->active());
  CHECK(world.server.id() != id);
}

TEST_CASE("A restarted client is back when its dead session has timed out") {
  World world;
  const Client& first = world.add(world.key);
  world.run(0.3);
  world.stop(first);
  const Client& again = world.add(world.key);  // from the same address and port
  CHECK(again.address.port == 50000);
  world.run(kTimeout - 0.1);
  CHECK_FALSE(again.session->active());
  world.run(0.4);
  CHECK(again.session->active());
}

TEST_CASE("A client without a key gets no answer, and is counted") {
  World world;
  const Client& client = world.add(std::nullopt);
  world.run(1);
  CHECK_FALSE(client.reason);
  CHECK(client.session->statistics().datagrams == 0);
  CHECK(world.server.statistics().count(DropReason::kUnsealed) > 5);
  CHECK(world.server.statistics().count(DropReason::kUnsealed) ==
        world.server.statistics().datagrams);
}

TEST_CASE("After a goodbye the server has forgotten the channel") {
  World world;
  Client& client = world.add(world.key);
  world.run(0.3);
  client.session->close(world.now);
  world.run(kStep / 2);
  const auto dropped = [&] { return world.server.statistics().count(DropReason::kForeignSession); };
  const std::uint64_t before = dropped();
  world.wire.deliver(client.address, world.latest_sealed);
  world.run(kStep / 2);
  CHECK(dropped() == before + 1);
}

TEST_CASE("After a goodbye either way the next session begins with new keys") {
  World world;
  Client& client = world.add(world.key);
  world.run(0.3);
  const std::uint64_t first = world.server.id();
  client.session->close(world.now);
  world.run(0.4);
  CHECK(client.session->active());
  CHECK(world.server.id() != first);
  const std::uint64_t second = world.server.id();
  world.server.close(world.now, GoodbyeReason::kShutdown);
  world.run(0.4);
  CHECK(client.session->active());
  CHECK(world.server.id() != second);
  CHECK(world.channels.size() == 3);
}

}  // namespace
}  // namespace hlm::protocol
