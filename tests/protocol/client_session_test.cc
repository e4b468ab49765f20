// The client's side of the session, on a link whose other side is the test.
#include "hlm/protocol/client_session.h"

#include <string>
#include <vector>

#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

using test::planar_hello;
using test::planar_state;
using test::planar_update;

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr Endpoint kOther{.address = 0x0A000009, .port = 47800};
constexpr std::uint64_t kSession = 7;

Welcome welcome(std::uint64_t nonce) {
  Welcome welcome;
  welcome.nonce = nonce;
  welcome.fingerprint = 5;
  return welcome;
}

struct Client {
  /// Nonce of the latest hello.
  std::uint64_t nonce() const {
    Hello hello;
    if (decode(view(link.sent().back().bytes), hello))
      throw std::logic_error("the latest datagram is not a hello");
    return hello.nonce;
  }
  void begin(double now = 0) {
    session.poll(now);
    link.deliver(kServer, {.session = kSession}, welcome(nonce()));
    REQUIRE(session.poll(now).welcomed);
    link.forget_sent();
  }
  void deliver_state(std::uint64_t sequence, const ProxyState& state) {
    link.deliver(kServer, {.session = kSession, .sequence = sequence}, state);
  }
  std::uint64_t dropped(DropReason reason) const { return session.statistics().count(reason); }

  test::QueueLink link;
  ClientSession session{
      link, {.server = kServer, .hello = planar_hello(11), .hello_period = 0.1, .timeout = 0.5}};
};

TEST_CASE("A client says hello at once and then in every period, with one nonce") {
  Client client;
  for (int i = 0; i <= 100; ++i) client.session.poll(0.01 * i + 1e-9 * i);
  CHECK(client.link.sent().size() == 11);
  CHECK(client.nonce() == 11);
  CHECK(client.link.sent().front().peer == kServer);
  CHECK(client.link.sent_header(0).envelope == Envelope{.session = 0, .sequence = 1});
  CHECK(client.link.sent_header(10).envelope.sequence == 11);
}

TEST_CASE("Only a welcome from the server with the nonce begins the session, and hellos end") {
  Client client;
  client.session.poll(0);
  client.link.deliver(kServer, {.session = 3}, welcome(12));
  client.link.deliver(kOther, {.session = 4}, welcome(11));
  CHECK_FALSE(client.session.poll(0.01).welcomed);
  CHECK(client.dropped(DropReason::kForeignSession) == 2);
  client.link.deliver(kServer, {.session = kSession}, Welcome{11, 500, 5});
  CHECK(client.session.poll(0.02).welcomed);
  CHECK(client.session.active());
  CHECK(client.session.welcome().servo_rate == 500);
  client.link.forget_sent();
  client.session.poll(5);
  CHECK(client.link.sent().empty());
}

TEST_CASE("Without a session nothing is sent") {
  Client client;
  CHECK(client.session.send(0, planar_update(1)) == 0);
  client.session.close(0);
  CHECK(client.link.sent().empty());
}

TEST_CASE("Updates are numbered from 1 and echo the newest proxy state and its hold") {
  Client client;
  client.begin(1);
  const auto sent_update = [&] {
    ContactUpdate update;
    REQUIRE_FALSE(decode(view(client.link.sent().back().bytes), update));
    return update;
  };
  CHECK(client.session.send(1.5, planar_update(0)) == 1);
  CHECK(sent_update().echo_step == 0);
  CHECK(client.link.sent_header(0).envelope ==
        Envelope{.session = kSession, .sequence = 1, .send_time = 1500000000});

  client.deliver_state(2, planar_state(400));
  client.session.poll(1.6);
  CHECK(client.session.send(1.625, planar_update(kMaxContacts)) == 2);
  CHECK(client.link.sent().size() == 1u + part_count(planar_update(kMaxContacts)));
  CHECK(client.session.send(1.65, planar_update(0)) == 3);
  CHECK(sent_update().echo_step == 400);
  CHECK(sent_update().echo_hold == Approx(0.05).margin(1e-12));
}

TEST_CASE("A goodbye counts whenever it comes, also overtaken by a proxy state") {
  Client client;
  client.begin();
  client.deliver_state(9, planar_state());
  client.link.deliver(kServer, {.session = kSession, .sequence = 5}, Goodbye{});
  CHECK(client.session.poll(0.1).lost);
}

TEST_CASE("The echo's hold and the round trip count from arrival, not from the frame's poll") {
  Client client;
  client.begin();
  client.session.send(1.5, planar_update(0));
  ProxyState state = planar_state(400);
  state.update_send_time = 1.5;
  state.hold = 0.002;
  client.link.set_waited(0.015);
  client.deliver_state(2, state);
  client.session.poll(1.52);
  CHECK(client.session.round_trip() == Approx(0.003).margin(1e-9));  // s
  client.session.send(1.53, planar_update(0));
  ContactUpdate update;
  REQUIRE_FALSE(decode(view(client.link.sent().back().bytes), update));
  CHECK(update.echo_hold == Approx(0.025).margin(1e-9));  // s
}

TEST_CASE("A refusal reaches the caller and keeps the session alive, totals of impulses too") {
  Client client;
  client.begin();
  client.session.send(0.1, planar_update(1));
  client.link.deliver(kServer, {.session = kSession, .sequence = 2},
                      Refusal{1, UpdateError::kNormal, true, 0, 1});
  ClientSession::Inbox inbox = client.session.poll(0.3);
  REQUIRE(inbox.refusal);
  CHECK(inbox.refusal->error == UpdateError::kNormal);
  CHECK_FALSE(client.session.poll(0.7).lost);

  Impulses impulses;
  impulses.step = 40;
  impulses.bodies.push_back({5, Vector6::Constant(0.1)});
  client.link.deliver(kServer, {.session = kSession, .sequence = 3}, impulses);
  inbox = client.session.poll(0.7);
  REQUIRE(inbox.impulses != nullptr);
  CHECK(inbox.impulses->bodies[0].body == 5);
  impulses.step = 39;
  client.link.deliver(kServer, {.session = kSession, .sequence = 4}, impulses);
  CHECK(client.session.poll(0.8).impulses == nullptr);
  CHECK(client.dropped(DropReason::kStale) == 1);
}

TEST_CASE("Of the proxy states of one poll the newest is shown, and never an older one again") {
  Client client;
  client.begin();
  for (const std::uint64_t sequence : {3u, 5u, 4u}) {
    client.deliver_state(sequence, planar_state(sequence));
  }
  const ClientSession::Inbox inbox = client.session.poll(0.1);
  REQUIRE(inbox.state != nullptr);
  CHECK(inbox.state->step == 5);
  CHECK(client.dropped(DropReason::kStale) == 1);
  client.deliver_state(5, planar_state(5));
  CHECK(client.session.poll(0.2).state == nullptr);
}

TEST_CASE("States of another session, another peer or another tool are dropped") {
  Client client;
  client.begin();
  client.link.deliver(kServer, {.session = kSession + 1, .sequence = 2}, planar_state());
  client.link.deliver(kOther, {.session = kSession, .sequence = 2}, planar_state());
  ProxyState other_tool = planar_state();
  other_tool.q = Eigen::Vector2d(0, 0);
  client.deliver_state(2, other_tool);
  client.link.deliver(kServer, {.session = kSession, .sequence = 2}, planar_update(0));
  CHECK(client.session.poll(0.1).state == nullptr);
  CHECK(client.dropped(DropReason::kForeignSession) == 2);
  CHECK(client.dropped(DropReason::kMalformed) == 1);
  CHECK(client.dropped(DropReason::kUnexpected) == 1);
}

TEST_CASE("The round trip leaves out the server's hold") {
  Client client;
  client.begin();
  client.session.send(10.0, planar_update(0));
  ProxyState state = planar_state();
  state.update_send_time = 10.0;
  state.hold = 0.003;
  client.deliver_state(2, state);
  client.session.poll(10.025);
  CHECK(client.session.round_trip() == Approx(0.022).margin(1e-9));
}

TEST_CASE("A server that is silent after an update is lost and asked again with a new nonce") {
  Client client;
  client.begin(0);
  CHECK_FALSE(client.session.poll(100).lost);  // Nothing was sent, so nothing is missing.
  client.session.send(100, planar_update(0));
  ProxyState state = planar_state();
  state.update_send_time = 100.4;  // s: it comes back in no time.
  client.deliver_state(2, state);
  CHECK_FALSE(client.session.poll(100.4).lost);
  client.session.send(101, planar_update(0));
  client.session.send(101.3, planar_update(0));
  CHECK_FALSE(client.session.poll(101.5).lost);
  CHECK(client.session.poll(101.51).lost);
  CHECK_FALSE(client.session.active());
  CHECK(client.nonce() != 11);
}

TEST_CASE("A far server is given a round trip more before it is lost") {
  Client client;
  client.begin(0);
  client.session.send(100, planar_update(0));
  ProxyState state = planar_state();
  state.update_send_time = 99.4;  // s: one second under way.
  client.deliver_state(2, state);
  CHECK_FALSE(client.session.poll(100.4).lost);
  client.session.send(101, planar_update(0));
  CHECK_FALSE(client.session.poll(102.4).lost);
  CHECK(client.session.poll(102.6).lost);
}

TEST_CASE("The server's goodbye ends the session") {
  Client client;
  client.begin();
  client.link.deliver(kServer, {.session = kSession, .sequence = 2},
                      Goodbye{GoodbyeReason::kShutdown});
  CHECK(client.session.poll(0.2).lost);
  CHECK_FALSE(client.session.active());
  CHECK(client.nonce() != 11);
}

TEST_CASE("Closing says goodbye once") {
  Client client;
  client.begin();
  client.session.close(1);
  CHECK(client.link.last_sent<Goodbye>().reason == GoodbyeReason::kFinished);
  CHECK_FALSE(client.session.active());
  client.session.close(1);
  CHECK(client.link.sent().size() == 1);
}

TEST_CASE("A refusal is shown, of another version of the protocol too, and the client asks on") {
  Client client;
  client.session.poll(0);
  Reject reject = test::reject_message("busy");
  reject.nonce = 12;
  client.link.deliver(kServer, {}, reject);
  CHECK_FALSE(client.session.poll(0.01).reject);
  reject.nonce = 11;
  client.link.deliver(kServer, {}, reject);
  const auto busy = client.session.poll(0.02).reject;
  REQUIRE(busy);
  CHECK(busy->reason == RejectReason::kBusy);

  reject.reason = RejectReason::kVersion;
  reject.version = 3;
  DatagramBytes other = encode({}, reject);
  other[4] = std::byte{3};
  client.link.deliver(kOther, other);
  CHECK_FALSE(client.session.poll(0.03).reject);
  client.link.deliver(kServer, other);
  const auto version = client.session.poll(0.04).reject;
  REQUIRE(version);
  CHECK(version->reason == RejectReason::kVersion);
  CHECK(version->version == 3);
  client.session.poll(0.15);
  CHECK(client.nonce() == 11);
}

TEST_CASE("A client that waits for its turn does not end a fault that comes meanwhile") {
  Client client;
  const auto clears_fault = [&] {
    Hello hello;
    REQUIRE_FALSE(decode(view(client.link.sent().back().bytes), hello));
    return hello.clears_fault;
  };
  client.session.poll(5);
  CHECK(clears_fault());
  client.session.poll(6.9);
  CHECK(clears_fault());
  client.session.poll(7.1);
  CHECK_FALSE(clears_fault());
}

TEST_CASE("Hellos carry the tool's present configuration") {
  Client client;
  client.session.set_initial_configuration(Vector3(1, 2, 3));
  client.session.poll(0);
  Hello hello;
  REQUIRE_FALSE(decode(std::vector{client.link.sent().back().bytes}, hello));
  CHECK(hello.q == Vector3(1, 2, 3));
}

TEST_CASE("A hello that no server could use is refused at once with what is wrong") {
  test::QueueLink link;
  const auto message = [&](const Hello& hello) -> std::string {
    try {
      const ClientSession session(link, {.server = kServer, .hello = hello});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  using Catch::Matchers::ContainsSubstring;
  CHECK(message(planar_hello()).empty());
  Hello hello = planar_hello();
  hello.tool.links[0].mass = -2;
  CHECK_THAT(message(hello), ContainsSubstring("mass"));
  hello = planar_hello();
  hello.ve_rate = 0;
  CHECK_THAT(message(hello), ContainsSubstring("VE rate 0"));
  hello = planar_hello();
  hello.epsilon = -1;
  CHECK_THAT(message(hello), ContainsSubstring("epsilon -1"));
  hello = planar_hello();
  hello.q = Configuration::Zero(4);
  CHECK_THAT(message(hello), ContainsSubstring("4 coordinates"));
  CHECK_THROWS_WITH(ClientSession(link, {.server = {1, 0}, .hello = planar_hello()}),
                    ContainsSubstring("port 0"));
}

/// A session whose server takes scenes.
void begin_with_scenes(Client& client, bool scenes = true) {
  client.session.poll(0);
  Welcome granted = welcome(client.nonce());
  granted.capabilities.scenes = scenes;
  client.link.deliver(kServer, {.session = kSession}, granted);
  REQUIRE(client.session.poll(0).welcomed);
  client.link.forget_sent();
}

TEST_CASE("A scene is sent in chunks within the budget, and the state tells what has come") {
  Client client;
  begin_with_scenes(client);
  const std::vector<std::uint8_t> bytes(5000, 7);
  REQUIRE_FALSE(client.session.queue_scene(bytes));
  CHECK(client.session.send_scene(0.01, 2) == 2);
  CHECK(client.session.send_scene(0.02, 10) == 3);
  CHECK(client.session.send_scene(0.03, 10) == 0);
  REQUIRE(client.link.sent().size() == 5);
  CHECK(client.link.last_sent<SceneChunk>().number == 4);
  CHECK(client.link.last_sent<SceneChunk>().data.size() == 5000 - 4 * kChunkSize);
  CHECK(client.link.sent_header(4).envelope.sequence == 5);

  SceneState state;
  state.next = 4;
  state.scene = 1;
  state.text = test::text("fine");
  client.link.deliver(kServer, {.session = kSession, .sequence = 3}, state);
  CHECK(client.session.poll(0.05).scene);
  CHECK(client.session.scene_state().scene == 1);
  CHECK(client.session.scene_sender().waiting() == 5000 - 4 * kChunkSize);
  state.scene = 0;
  client.link.deliver(kServer, {.session = kSession, .sequence = 2}, state);
  CHECK_FALSE(client.session.poll(0.06).scene);
  CHECK(client.dropped(DropReason::kStale) == 1);
  state.next = 6;  // was never sent
  client.link.deliver(kServer, {.session = kSession, .sequence = 4}, state);
  CHECK_FALSE(client.session.poll(0.07).scene);
  CHECK(client.dropped(DropReason::kMalformed) == 1);
  CHECK(client.session.scene_state().scene == 1);
  // A scene state keeps no proxy state away.
  client.deliver_state(1 + 1, planar_state());
  CHECK(client.session.poll(0.08).state != nullptr);
}

TEST_CASE("A scene is queued only where a server takes it, within the limit, for one session") {
  Client client;
  const std::vector<std::uint8_t> bytes(10);
  CHECK(client.session.queue_scene(bytes).value() == "there is no session to send a scene in");
  CHECK(client.session.send_scene(0, 10) == 0);
  SECTION("an older server") {
    begin_with_scenes(client, false);
    CHECK(client.session.queue_scene(bytes).value() ==
          "the server takes no scenes: it is older, or set so");
  }
  SECTION("too much") {
    begin_with_scenes(client);
    REQUIRE_FALSE(client.session.queue_scene(bytes));
    const std::vector<std::uint8_t> all(SceneSender::kMostQueued);
    CHECK(client.session.queue_scene(all).value() ==
          "a scene of 67108864 bytes must be at most 67108854, with what waits 67108864");
  }
  SECTION("the next session") {
    begin_with_scenes(client);
    REQUIRE_FALSE(client.session.queue_scene(bytes));
    client.session.close(0.1);
    CHECK(client.session.send_scene(0.1, 10) == 0);
    client.session.poll(0.3);
    client.link.deliver(kServer, {.session = kSession + 1}, welcome(client.nonce()));
    REQUIRE(client.session.poll(0.3).welcomed);
    CHECK(client.session.send_scene(0.3, 10) == 0);
    CHECK(client.session.scene_sender().waiting() == 0);
  }
}

}  // namespace
}  // namespace hlm::protocol
