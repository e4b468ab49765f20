// Sealed links, and an enemy on the wire between them who keeps every packet: he holds it back,
// repeats it, alters it, sends it elsewhere and makes up his own. Keys of handshakes and indices
// are drawn at random: of one input the bytes on the wire differ from run to run, what happens does
// not.
#include <algorithm>
#include <cstring>
#include <deque>
#include <optional>

#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/sealing/sealed_server_link.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/wire_actions.h"
#include "tests/protocol/queue_link.h"

namespace hlm::fuzz {
namespace {

using protocol::Datagram;
using protocol::DatagramBytes;
using protocol::Endpoint;

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr std::size_t kClients = 3;  ///< The last one has another key.
constexpr int kMostSteps = 400;

Endpoint address_of(std::size_t client) {
  return {.address = 0x0A000002, .port = static_cast<std::uint16_t>(50000 + client)};
}

protocol::noise::Key key_of(std::uint8_t content) {
  protocol::noise::Key key;
  std::fill(key.begin(), key.end(), std::byte{content});
  return key;
}

struct Client {
  Client(std::size_t number, const double& now)
      : address(address_of(number)),
        has_key(number + 1 < kClients),
        link(wire, kServer, key_of(has_key ? 1 : 2), [&now] { return now; }) {}

  Endpoint address;
  bool has_key;
  test::QueueLink wire;
  protocol::SealedClientLink link;
};

struct Packet {
  std::optional<std::size_t> to;  ///< A client; empty: the server.
  std::size_t client = 0;         ///< At whichever end.
  DatagramBytes bytes;
};

class Wire {
 public:
  Wire() {
    for (std::size_t i = 0; i < kClients; ++i) clients_.emplace_back(i, now_);
  }

  void take(const WireStep& step, Input& input) {
    const std::size_t whom = step.whom % kClients;
    Client& client = clients_[whom];
    switch (step.action) {
      case WireAction::kSay:
        client.link.send(kServer,
                         protocol::view(new_text(step.size, {true, whom, client.has_key})));
        break;
      case WireAction::kAnswer:
        if (heard_)
          server_.send(*heard_, protocol::view(new_text(step.size, {false, speaker_, true})));
        break;
      case WireAction::kPass:
        if (const Packet* packet = find(step.which)) deliver(*packet);
        break;
      case WireAction::kAlter:
        if (const Packet* packet = find(step.which)) deliver(altered(*packet, step));
        break;
      case WireAction::kRedirect:
        if (const Packet* packet = find(step.which)) deliver({{}, whom, packet->bytes});
        break;
      case WireAction::kReflect:
        if (const Packet* packet = find(step.which)) deliver({whom, whom, packet->bytes});
        break;
      case WireAction::kInvent:
        deliver({{}, whom, made_up(input.take(step.size))});
        break;
      case WireAction::kWait:
        now_ += 4e-3 * step.place;
        break;
      case WireAction::kKeep:
        if (heard_) server_.keep(*heard_);
        break;
      case WireAction::kForget:
        forget(client, step.place % 2 == 0);
        break;
    }
    collect();
  }

 private:
  struct Text {
    bool to_server = false;
    std::size_t client = 0;  ///< At the other end, whatever address the enemy gives him.
    bool may_arrive = false;
    bool arrived = false;
  };

  /// No two are alike.
  DatagramBytes new_text(std::size_t size, const Text& text) {
    DatagramBytes bytes(8 + 4 * size);
    const std::uint64_t number = texts_.size();
    std::memcpy(bytes.data(), &number, sizeof number);
    texts_.push_back(text);
    return bytes;
  }

  static DatagramBytes made_up(std::span<const std::uint8_t> content) {
    DatagramBytes bytes;
    for (const std::uint8_t byte : content) bytes.push_back(std::byte{byte});
    return bytes;
  }

  static Packet altered(Packet packet, const WireStep& step) {
    const auto longer = static_cast<std::int8_t>(step.size);
    const auto size = static_cast<std::ptrdiff_t>(packet.bytes.size()) + longer;
    packet.bytes.resize(
        static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(size, 0, protocol::kMaxDatagram)));
    if (!packet.bytes.empty()) {
      packet.bytes[step.place % packet.bytes.size()] ^= std::byte{0x10};
    }
    return packet;
  }

  const Packet* find(std::size_t back) const {
    return back < packets_.size() ? &packets_[packets_.size() - 1 - back] : nullptr;
  }

  void forget(Client& client, bool at_client) {
    if (at_client) client.link.forget(kServer);
    if (!at_client && heard_) server_.forget(*heard_);
  }

  void deliver(const Packet& packet) {
    if (packet.to) {
      Client& client = clients_[*packet.to];
      client.wire.deliver(kServer, packet.bytes);
      receive(client.link, [&](const Text& text, const Endpoint&) {
        demand(!text.to_server && text.client == *packet.to, "what opens was sealed for him");
      });
    } else {
      wire_.deliver(address_of(packet.client), packet.bytes);
      receive(server_, [&](const Text& text, const Endpoint& peer) {
        demand(text.to_server, "what opens was sealed for the server");
        demand(peer.port == address_of(packet.client).port, "its peer is where it came from");
        heard_ = peer;
        speaker_ = text.client;
      });
    }
  }

  /// All that a link has to give.
  template <class Check>
  void receive(protocol::DatagramLink& link, Check check) {
    Datagram datagram;
    while (link.receive(datagram)) {
      if (datagram.dropped) {
        demand(datagram.bytes.empty(), "of what is dropped nothing is left");
        continue;
      }
      std::uint64_t number = texts_.size();
      demand(datagram.bytes.size() >= sizeof number, "what opens is a text that was sealed");
      std::memcpy(&number, datagram.bytes.data(), sizeof number);
      demand(number < texts_.size(), "what opens is a text that was sealed");
      Text& text = texts_[number];
      demand(text.may_arrive, "without the key nothing opens");
      demand(!text.arrived, "a text opens once");
      text.arrived = true;
      check(text, datagram.peer);
      ++accepted;
    }
  }

  /// What the links have sent is the enemy's.
  void collect() {
    for (std::size_t i = 0; i < kClients; ++i) {
      for (const Datagram& sent : clients_[i].wire.sent()) packets_.push_back({{}, i, sent.bytes});
      clients_[i].wire.forget_sent();
    }
    for (const Datagram& sent : wire_.sent()) {
      const std::size_t client = sent.peer.port - address_of(0).port;
      demand(client < kClients, "the server sends to those who spoke to it");
      responses_ +=
          protocol::kind_of(protocol::view(sent.bytes)).type == protocol::PacketType::kResponse;
      packets_.push_back({client, client, sent.bytes});
    }
    wire_.forget_sent();
    // New ones, and for each its repetitions.
    constexpr double kRate = protocol::SealedServerLink::kHandshakeRate;
    demand(responses_ <= 2 + 3 * kRate * now_ + 1e-6, "handshakes are answered at a bounded rate");
  }

  double now_ = 0;
  test::QueueLink wire_;
  protocol::SealedServerLink server_{wire_, key_of(1), [this] { return now_; }};
  std::deque<Client> clients_;
  std::deque<Packet> packets_;
  std::deque<Text> texts_;
  std::optional<Endpoint> heard_;  ///< By the server, the latest,
  std::size_t speaker_ = 0;        ///< and which client that is.
  double responses_ = 0;
};

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm::fuzz;
  Input input(data, size);
  Wire wire;
  for (int i = 0; i < kMostSteps && !input.empty(); ++i) {
    WireStep step;
    step.action = static_cast<WireAction>(input.u8() % kWireActions);
    for (std::uint8_t* field : {&step.whom, &step.which, &step.size, &step.place}) {
      *field = input.u8();
    }
    wire.take(step, input);
  }
  return 0;
}
