// Both ends of sealed datagrams, and what comes between them from someone without the key.
#include <algorithm>
#include <deque>
#include <string>
#include <vector>

#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/sealing/sealed_server_link.h"
#include "tests/protocol/queue_link.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"

namespace hlm::protocol {
namespace {

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr Endpoint kAddress{.address = 0x0A000002, .port = 50000};
constexpr Endpoint kElsewhere{.address = 0x0A000002, .port = 50001};
constexpr double kHandshakePeriod = 1.001 / SealedServerLink::kHandshakeRate;  // s

using Texts = std::vector<DatagramBytes>;

DatagramBytes text(const std::string& words) {
  const auto bytes = std::as_bytes(std::span(words));
  return {bytes.begin(), bytes.end()};
}

/// All that a link has to give: texts, and why others were dropped.
struct Received {
  explicit Received(DatagramLink& link) {
    Datagram datagram;
    while (link.receive(datagram)) {
      if (datagram.dropped) {
        CHECK(datagram.bytes.empty());
        dropped.push_back(*datagram.dropped);
      } else {
        texts.push_back(datagram.bytes);
        peer = datagram.peer;
      }
    }
  }

  Texts texts;
  std::vector<DropReason> dropped;
  Endpoint peer;  ///< Of the latest text.
};

struct Client {
  explicit Client(const double& now, const noise::Key& key, Endpoint own = kAddress)
      : address(own), link(wire, kServer, key, [&now] { return now; }) {}

  Endpoint address;
  test::QueueLink wire;
  SealedClientLink link;
};

/// A server, clients, and the wire between them, on which every packet stays to be used again.
struct Network {
  Client client(Endpoint address = kAddress) { return Client(now, key, address); }

  void to_server(Client& client) {
    for (const Datagram& datagram : client.wire.sent()) {
      passed.push_back(datagram.bytes);
      wire.deliver(client.address, datagram.bytes);
    }
    client.wire.forget_sent();
  }
  void to_client(Client& client) {
    for (const Datagram& datagram : wire.sent()) {
      if (datagram.peer == client.address) client.wire.deliver(kServer, datagram.bytes);
    }
    wire.forget_sent();
  }
  Received say(Client& client, const std::string& words) {
    client.link.send(kServer, view(text(words)));
    to_server(client);
    return Received(server);
  }
  Received answer(Client& client, const Endpoint& peer, const std::string& words) {
    server.send(peer, view(text(words)));
    to_client(client);
    return Received(client.link);
  }
  /// A handshake, proved by a first text, which is answered. The peer as which the server knows the
  /// client.
  Endpoint connect(Client& client) {
    now += kHandshakePeriod;
    CHECK(say(client, "lost").texts.empty());
    to_client(client);
    CHECK(Received(client.link).texts.empty());
    const Received first = say(client, "proof");
    REQUIRE(first.texts == Texts{text("proof")});
    CHECK(answer(client, first.peer, "welcome").texts.size() == 1);
    return first.peer;
  }
  Received replay(const DatagramBytes& packet, const Endpoint& from = kAddress) {
    wire.deliver(from, packet);
    return Received(server);
  }

  double now = 0;
  noise::Key key = noise::random_key_pair().secret_key;
  test::QueueLink wire;
  SealedServerLink server{wire, key, [this] { return now; }};
  std::vector<DatagramBytes> passed;
};

TEST_CASE("After a handshake both sides read each other, and nothing on the wire is readable") {
  Network network;
  Client client = network.client();
  const Endpoint peer = network.connect(client);
  CHECK(peer.address == kAddress.address);
  CHECK(peer.port == kAddress.port);
  CHECK(peer.channel != 0);
  CHECK(network.say(client, "a long enough secret").texts == Texts{text("a long enough secret")});
  CHECK(network.answer(client, peer, "another secret").texts == Texts{text("another secret")});
  for (const DatagramBytes& packet : network.passed) {
    const DatagramBytes word = text("secret");
    CHECK(std::search(packet.begin(), packet.end(), word.begin(), word.end()) == packet.end());
  }
}

TEST_CASE("Without the key, with another one, or unsealed: no answer and nothing delivered") {
  Network network;
  Client other(network.now, noise::random_key_pair().secret_key);
  const Received wrong = network.say(other, "hello");
  CHECK(wrong.dropped == std::vector{DropReason::kWrongKey});
  const Received unsealed = network.replay(text("HLMI and more"));
  CHECK(unsealed.dropped == std::vector{DropReason::kUnsealed});
  CHECK(network.replay(text("GET / HTTP/1.1")).dropped == std::vector{DropReason::kNotOurs});
  CHECK(network.replay(text("HLS")).dropped == std::vector{DropReason::kTruncated});
  CHECK(network.replay({}).dropped == std::vector{DropReason::kTruncated});
  CHECK(network.wire.sent().empty());
}

TEST_CASE("A whole recorded session, replayed at its server or at another, is dropped whole") {
  Network network;
  Client client = network.client();
  const Endpoint peer = network.connect(client);
  for (int i = 0; i < 20; ++i) network.say(client, "update");
  network.answer(client, peer, "state");
  const auto recorded = network.passed;
  network.now += 1;
  for (const Endpoint& from : {kAddress, kElsewhere}) {
    for (const DatagramBytes& packet : recorded) {
      const Received result = network.replay(packet, from);
      CHECK(result.texts.empty());
      CHECK(result.dropped.size() == 1);
    }
  }
  CHECK(network.wire.sent().empty());
  CHECK(network.say(client, "still here").texts.size() == 1);

  // Another one answers the first message, but nothing follows from that.
  SealedServerLink restarted(network.wire, network.key, [&network] { return network.now; });
  for (const DatagramBytes& packet : recorded) network.wire.deliver(kAddress, packet);
  const Received result(restarted);
  CHECK(result.texts.empty());
  CHECK(result.dropped.size() == recorded.size() - 1);
  CHECK(network.wire.sent().size() == 1);
  restarted.send(peer, view(text("reply")));
  CHECK(network.wire.sent().size() == 1);
}

TEST_CASE("A packet from another address or port than its handshake's is foreign") {
  Network network;
  Client client = network.client();
  network.connect(client);
  client.link.send(kServer, view(text("moved")));
  const DatagramBytes packet = client.wire.sent().back().bytes;
  CHECK(network.replay(packet, kElsewhere).dropped == std::vector{DropReason::kForeignSession});
  CHECK(network.replay(packet).texts == Texts{text("moved")});
}

TEST_CASE("No changed bit of any packet gets through, or hinders the packet itself") {
  Network network;
  Client client = network.client();
  network.now += kHandshakePeriod;
  client.link.send(kServer, view(text("lost")));
  const DatagramBytes initiation = client.wire.sent().back().bytes;
  for (std::size_t bit = 0; bit < 8 * initiation.size(); ++bit) {
    DatagramBytes changed = initiation;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    network.now += 1e-3;
    CHECK(network.replay(changed).dropped.size() == 1);
  }
  CHECK(network.wire.sent().empty());
  network.to_server(client);
  CHECK(Received(network.server).dropped.empty());

  REQUIRE(network.wire.sent().size() == 1);
  const DatagramBytes response = network.wire.sent().back().bytes;
  for (std::size_t bit = 0; bit < 8 * response.size(); ++bit) {
    DatagramBytes changed = response;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    client.wire.deliver(kServer, changed);
    CHECK(Received(client.link).dropped.size() == 1);
  }
  client.wire.deliver(kServer, response);
  CHECK(Received(client.link).dropped.empty());

  client.link.send(kServer, view(text("update")));
  const DatagramBytes sealed = client.wire.sent().back().bytes;
  for (std::size_t bit = 0; bit < 8 * sealed.size(); ++bit) {
    DatagramBytes changed = sealed;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    const Received result = network.replay(changed);
    CHECK(result.texts.empty());
    CHECK(result.dropped.size() == 1);
  }
  CHECK(network.replay(sealed).texts == Texts{text("update")});
}

TEST_CASE("A first message that is repeated before the proof gets the same response, then none") {
  Network network;
  Client client = network.client();
  network.say(client, "lost");
  REQUIRE(network.wire.sent().size() == 1);
  const DatagramBytes response = network.wire.sent()[0].bytes;
  network.wire.forget_sent();  // the response is lost
  network.now += kHandshakePeriod;
  network.say(client, "lost");
  REQUIRE(network.wire.sent().size() == 1);
  CHECK(network.wire.sent()[0].bytes == response);
  network.to_client(client);
  Received(client.link);
  CHECK(network.say(client, "proof").texts.size() == 1);
  network.now += kHandshakePeriod;
  CHECK(network.replay(network.passed[0]).dropped == std::vector{DropReason::kReplayed});
}

TEST_CASE("Handshakes with the key are answered ten times a second, however many are asked for") {
  Network network;
  constexpr double kDuration = 10;  // s
  std::size_t refused = 0;
  for (; network.now < kDuration; network.now += 1e-3) {
    Client client = network.client(kElsewhere);
    const Received result = network.say(client, "lost");
    refused +=
        static_cast<std::size_t>(std::ranges::count(result.dropped, DropReason::kHandshakeRate));
  }
  const double answered = static_cast<double>(network.wire.sent().size());
  CHECK(answered == Approx(SealedServerLink::kHandshakeRate * kDuration).margin(2));
  CHECK(static_cast<double>(refused) == Approx(1e3 * kDuration - answered).margin(2));
}

TEST_CASE("Handshakes that prove nothing displace no channel that has") {
  Network network;
  Client client = network.client();
  const Endpoint kept = network.connect(client);
  network.server.keep(kept);
  Client second = network.client(kElsewhere);
  const Endpoint newcomer = network.connect(second);
  for (int i = 0; i < 100; ++i) {
    network.now += kHandshakePeriod;
    Client unproven = network.client({.address = 1, .port = static_cast<std::uint16_t>(1 + i)});
    network.say(unproven, "lost");
  }
  CHECK(network.answer(client, kept, "state").texts.size() == 1);
  CHECK(network.answer(second, newcomer, "busy").texts.size() == 1);
}

TEST_CASE("The session's channel stays whoever proves himself, and goes when another's is kept") {
  Network network;
  Client client = network.client();
  const Endpoint kept = network.connect(client);
  network.server.keep(kept);
  std::deque<Client> others;
  Endpoint newest;
  for (std::uint16_t port = 1; port <= 5; ++port) {
    others.emplace_back(network.now, network.key, Endpoint{.address = 7, .port = port});
    newest = network.connect(others.back());
    CHECK(network.answer(client, kept, "state").texts.size() == 1);
  }
  CHECK(network.say(others[3], "displaced").dropped == std::vector{DropReason::kForeignSession});
  network.server.keep(newest);
  CHECK(network.say(client, "too late").dropped == std::vector{DropReason::kForeignSession});
  CHECK(network.say(others[4], "mine").texts.size() == 1);
}

TEST_CASE("Two channels of one address are two peers") {
  Network network;
  Client first = network.client();
  const Endpoint before = network.connect(first);
  network.server.keep(before);
  Client restarted = network.client();
  const Endpoint after = network.connect(restarted);
  CHECK(before != after);
  network.server.send(before, view(text("to the first")));
  network.server.send(after, view(text("to the second")));
  network.to_client(restarted);
  const Received result(restarted.link);
  CHECK(result.texts == Texts{text("to the second")});
  CHECK(result.dropped == std::vector{DropReason::kForeignSession});
}

TEST_CASE("A client asks anew when its server was restarted, half a second after its last word") {
  Network network;
  Client client = network.client();
  network.connect(client);
  SealedServerLink restarted(network.wire, network.key, [&network] { return network.now; });
  const double begin = network.now;
  Texts texts;
  while (texts.empty() && network.now < begin + 2) {
    network.now += 0.1;
    client.link.send(kServer, view(text("hello")));
    network.to_server(client);
    texts = Received(restarted).texts;
    network.to_client(client);
    Received(client.link);
  }
  CHECK(texts == Texts{text("hello")});
  CHECK(network.now - begin < SealedClientLink::kPatience + 0.4);
}

TEST_CASE("Each session has keys of its own") {
  Network network;
  Client client = network.client();
  const Endpoint first = network.connect(client);
  network.server.keep(first);
  client.link.forget(kServer);
  const Endpoint second = network.connect(client);
  CHECK(first.channel != second.channel);
  network.server.forget(second);
  CHECK(network.say(client, "after the end").dropped == std::vector{DropReason::kForeignSession});
}

TEST_CASE("Random bytes of every length open nothing and get no answer") {
  INFO("seed " << test::random_seed());
  test::Random random;
  Network network;
  Client client = network.client();
  network.connect(client);
  for (int i = 0; i < 100'000; ++i) {
    DatagramBytes packet;
    packet.resize(static_cast<std::size_t>(random.integer(0, kMaxDatagram)));
    for (std::byte& byte : packet) byte = static_cast<std::byte>(random.integer(0, 255));
    // Half of them with what is known: magic, a type, lengths, a receiver.
    const DatagramBytes& like = network.passed[static_cast<std::size_t>(i) % network.passed.size()];
    if (random.integer(0, 1) == 0) {
      if (random.integer(0, 1) == 0) packet.resize(like.size());
      std::copy_n(like.begin(), std::min<std::size_t>(packet.size(), 8), packet.begin());
    }
    network.now += 1e-4;
    Datagram datagram;
    network.wire.deliver(kAddress, packet);
    REQUIRE(network.server.receive(datagram));
    REQUIRE(datagram.dropped);
    client.wire.deliver(kServer, packet);
    REQUIRE(client.link.receive(datagram));
    REQUIRE(datagram.dropped);
  }
  CHECK(network.wire.sent().empty());
  CHECK(network.say(client, "still here").texts.size() == 1);
}

TEST_CASE("Handshake, opening, sealing and refusing allocate nothing") {
  Network network;
  Client client = network.client();
  network.connect(client);
  client.link.forget(kServer);
  network.now += 1;
  const DatagramBytes words = text("words");
  std::size_t allocations = 0;
  const auto guarded = [&allocations](auto&& action) {
    const test::NoMalloc guard;
    action();
    allocations += guard.allocations();
  };
  Datagram datagram;
  guarded([&] { client.link.send(kServer, view(words)); });
  network.to_server(client);
  guarded([&] { network.server.receive(datagram); });
  network.to_client(client);
  guarded([&] { client.link.receive(datagram); });
  guarded([&] { client.link.send(kServer, view(words)); });
  network.to_server(client);
  guarded([&] { REQUIRE(network.server.receive(datagram)); });
  const Endpoint peer = datagram.peer;
  CHECK(datagram.bytes == words);
  guarded([&] { network.server.keep(peer); });
  guarded([&] { network.server.send(peer, view(words)); });
  for (const DatagramBytes& packet : network.passed) network.wire.deliver(kElsewhere, packet);
  guarded([&] {
    while (network.server.receive(datagram)) {
    }
  });
  guarded([&] { network.server.forget(peer); });
  CHECK(allocations == 0);
}

}  // namespace
}  // namespace hlm::protocol
