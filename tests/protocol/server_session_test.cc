// The server's side of the session, on a link whose other side is the test.
#include "hlm/protocol/server_session.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"

namespace hlm::protocol {
namespace {

using Catch::Matchers::ContainsSubstring;
using test::planar_hello;
using test::planar_update;

constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr Endpoint kOther{.address = 0x0A000003, .port = 50000};
constexpr std::uint64_t kFirstId = 77;
constexpr double kTimeout = 1.0;

struct Server {
  /// Polls, and grants what is asked for.
  ServerSession::Inbox poll(double now) {
    const ServerSession::Inbox inbox = session.poll(now);
    if (inbox.hello) session.accept(now, {.servo_rate = 1000, .fingerprint = 5});
    return inbox;
  }
  void say_hello(const Endpoint& peer, std::uint64_t nonce) {
    link.deliver(peer, {.sequence = ++hellos}, planar_hello(nonce));
  }
  /// A session with kClient, nonce 1.
  void begin(double now = 0) {
    say_hello(kClient, 1);
    REQUIRE(poll(now).hello != nullptr);
    link.forget_sent();
  }
  void deliver_update(std::uint64_t sequence, std::size_t contacts = 0) {
    link.deliver(kClient, {.session = session.id(), .sequence = sequence},
                 planar_update(contacts, static_cast<double>(sequence)));
  }
  std::uint64_t dropped(DropReason reason) const { return session.statistics().count(reason); }

  test::QueueLink link;
  ServerSession session{link, {.first_session_id = kFirstId, .timeout = kTimeout}};
  std::uint64_t hellos = 0;
};

TEST_CASE("A hello is shown to the caller, and accept answers it with a welcome") {
  Server server;
  server.say_hello(kClient, 42);
  const ServerSession::Inbox inbox = server.session.poll(2.5);
  REQUIRE(inbox.hello != nullptr);
  CHECK(inbox.hello->nonce == 42);
  CHECK(inbox.hello->q == planar_hello().q);
  CHECK_FALSE(server.session.active());
  CHECK(server.link.sent().empty());

  server.session.accept(2.5, {.servo_rate = 1000, .fingerprint = 5});
  CHECK(server.session.active());
  const auto welcome = server.link.last_sent<Welcome>();
  CHECK(welcome.nonce == 42);
  CHECK(welcome.servo_rate == 1000);
  CHECK(welcome.fingerprint == 5);
  CHECK(server.link.sent().back().peer == kClient);
  const Envelope envelope = server.link.sent_header(0).envelope;
  CHECK(envelope == Envelope{.session = kFirstId, .sequence = 1, .send_time = 2500000000});
}

TEST_CASE("Session ids after a given first one are random: two servers share none") {
  std::vector<std::uint64_t> drawn;
  for (int i = 0; i < 2; ++i) {
    Server server;
    for (std::uint64_t nonce = 1; nonce <= 20; ++nonce) {
      server.say_hello(kClient, nonce);
      server.poll(static_cast<double>(nonce) * 2 * kTimeout);
      if (nonce == 1) CHECK(server.session.id() == kFirstId);
      if (nonce > 1) drawn.push_back(server.session.id());
    }
  }
  REQUIRE(drawn.size() == 38);
  CHECK(std::find(drawn.begin(), drawn.end(), 0) == drawn.end());
  std::sort(drawn.begin(), drawn.end());
  CHECK(std::adjacent_find(drawn.begin(), drawn.end()) == drawn.end());
}

TEST_CASE("A repeated hello repeats the welcome and begins no new session") {
  Server server;
  server.begin();
  server.say_hello(kClient, 1);
  CHECK(server.poll(0.1).hello == nullptr);
  CHECK(server.session.id() == kFirstId);
  CHECK(server.link.last_sent<Welcome>().nonce == 1);
}

TEST_CASE(
    "A second client hears that the server is busy while the first is live, and served after its "
    "timeout") {
  Server server;
  server.begin(0);
  server.deliver_update(1);
  server.poll(0.9);
  server.say_hello(kOther, 2);
  CHECK(server.poll(1.8).hello == nullptr);
  CHECK(server.link.last_sent<Reject>().reason == RejectReason::kBusy);
  CHECK(server.link.last_sent<Reject>().nonce == 2);
  CHECK(server.link.sent().back().peer == kOther);
  CHECK(server.dropped(DropReason::kForeignSession) == 1);
  CHECK(server.session.id() == kFirstId);

  server.say_hello(kOther, 2);
  CHECK(server.poll(1.95).hello != nullptr);
  CHECK(server.session.id() != kFirstId);
}

TEST_CASE("After a goodbye another client is served at once") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, Goodbye{});
  CHECK(server.poll(0.1).goodbye);
  CHECK_FALSE(server.session.active());
  server.say_hello(kOther, 2);
  CHECK(server.poll(0.1).hello != nullptr);
}

TEST_CASE("A hello from the client's own address takes its session no sooner than another's") {
  Server server;
  server.begin(0);
  server.say_hello(kClient, 2);
  CHECK(server.poll(kTimeout).hello == nullptr);
  CHECK(server.link.last_sent<Reject>().reason == RejectReason::kBusy);
  CHECK(server.session.id() == kFirstId);
  // And it leaves no trace: the session is no more alive for it.
  server.say_hello(kClient, 2);
  CHECK(server.poll(1.01 * kTimeout).hello != nullptr);
  CHECK(server.session.id() != kFirstId);
}

TEST_CASE("What shows that the client lives is told: updates, their parts, controls") {
  Server server;
  server.begin(0);
  CHECK_FALSE(server.poll(0.1).heard);
  server.deliver_update(1);
  CHECK(server.poll(0.1).heard);
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 2}, Control{});
  CHECK(server.poll(0.1).heard);
  const auto large = planar_update(64);
  server.link.deliver(kClient, encode({.session = kFirstId, .sequence = 3}, large, 0));
  CHECK(server.poll(0.1).heard);
  server.link.deliver(kClient, encode({.session = kFirstId, .sequence = 1}, large, 0));  // stale
  server.say_hello(kClient, 1);
  CHECK_FALSE(server.poll(0.1).heard);
}

TEST_CASE("A late copy of the hello of an ended session does not begin it again") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, Goodbye{});
  server.poll(0.1);
  const std::uint64_t id = server.session.id();
  server.say_hello(kClient, 1);
  CHECK(server.poll(0.2).hello == nullptr);
  CHECK(server.session.id() == id);
  CHECK(server.dropped(DropReason::kStale) == 1);
}

Control held_at(double x) {
  Control control;
  control.holds = true;
  control.X_WTarget.p.x() = x;
  return control;
}

TEST_CASE("A control waits for an update after it, and the acknowledgement names it") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 3}, held_at(0.3));
  server.deliver_update(2);  // older than the control
  CHECK(server.poll(0.1).control == nullptr);
  server.session.acknowledge(0.1, test::planar_state());
  CHECK(server.link.last_sent<ProxyState>().control == 0);

  server.deliver_update(4);
  const ServerSession::Inbox inbox = server.poll(0.2);
  REQUIRE(inbox.control != nullptr);
  CHECK(inbox.control->X_WTarget.p.x() == 0.3);
  server.session.acknowledge(0.2, test::planar_state());
  CHECK(server.link.last_sent<ProxyState>().control == 3);
  server.deliver_update(5);
  CHECK(server.poll(0.3).control == nullptr);  // in effect already
}

TEST_CASE("A control that comes after the update of the same poll does not take its place") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, held_at(0.1));
  server.deliver_update(2);
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 3}, held_at(0.3));
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.control != nullptr);
  CHECK(inbox.control->X_WTarget.p.x() == 0.1);
  server.deliver_update(4);
  const ServerSession::Inbox next = server.poll(0.2);
  REQUIRE(next.control != nullptr);
  CHECK(next.control->X_WTarget.p.x() == 0.3);
}

TEST_CASE("Older and foreign controls are dropped, and a new session begins without one") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 5}, held_at(0.5));
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 4}, held_at(0.4));
  server.link.deliver(kOther, {.session = kFirstId, .sequence = 6}, held_at(0.6));
  server.link.deliver(kClient, {.session = kFirstId + 1, .sequence = 6}, held_at(0.6));
  server.poll(0.1);
  CHECK(server.dropped(DropReason::kStale) == 1);
  CHECK(server.dropped(DropReason::kForeignSession) == 2);

  server.say_hello(kClient, 2);
  REQUIRE(server.poll(0.2 + kTimeout).hello != nullptr);
  server.deliver_update(9);
  const auto inbox = server.poll(0.3 + kTimeout);
  CHECK(inbox.update != nullptr);
  CHECK(inbox.control == nullptr);
}

TEST_CASE("Of the updates of one poll the newest is taken, whatever their order") {
  Server server;
  server.begin();
  for (const std::uint64_t sequence : {2u, 5u, 3u, 5u, 4u}) server.deliver_update(sequence);
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update != nullptr);
  CHECK(inbox.update->ve_time == 5);
  CHECK(server.dropped(DropReason::kStale) == 3);
  server.deliver_update(4);
  CHECK(server.poll(0.2).update == nullptr);
}

TEST_CASE("Updates of another session or another peer are foreign") {
  Server server;
  server.begin();
  server.link.deliver(kClient, {.session = kFirstId + 1, .sequence = 1}, planar_update(0));
  server.link.deliver(kOther, {.session = kFirstId, .sequence = 1}, planar_update(0));
  CHECK(server.poll(0.1).update == nullptr);
  CHECK(server.dropped(DropReason::kForeignSession) == 2);
}

TEST_CASE("An update that does not fit the tool is refused, and the one before it stays") {
  Server server;
  server.begin();
  server.deliver_update(1);
  ContactUpdate wrong = planar_update(20);
  wrong.q_VE = Vector6::Zero();
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 2}, wrong);
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update != nullptr);
  CHECK(inbox.update->ve_time == 1);
  CHECK(server.dropped(DropReason::kMalformed) == part_count(wrong));
  const auto refusal = server.link.last_sent<Refusal>();
  CHECK(refusal.refused == 2);
  CHECK(refusal.error == UpdateError::kTool);
  CHECK(refusal.whole);
  CHECK(refusal.count == 1);
}

TEST_CASE("Nothing refused leaves a trace: later updates of smaller sequences are taken") {
  constexpr std::uint64_t kLargest = ~std::uint64_t{0};
  Server server;
  server.begin();
  server.deliver_update(1);
  server.poll(0.1);
  SECTION("a number that is not finite") {
    ContactUpdate bad = planar_update(0);
    bad.ve_time = std::numeric_limits<double>::quiet_NaN();
    server.link.deliver(kClient, {.session = kFirstId, .sequence = 1000}, bad);
  }
  SECTION("cut short") {
    DatagramBytes bytes = encode({.session = kFirstId, .sequence = 1000}, planar_update(0));
    bytes.resize(41);
    bytes[36] = std::byte{41};
    bytes[37] = std::byte{0};
    server.link.deliver(kClient, bytes);
  }
  SECTION("a second part that is wrong") {
    ContactUpdate bad = planar_update(20);
    bad.contacts.back().n_W.setZero();
    server.link.deliver(kClient, {.session = kFirstId, .sequence = 1000}, bad);
  }
  SECTION("a quaternion, a length, a tool that is not the session's") {
    ContactUpdate bad = planar_update(0);
    bad.v_VE = Vector6::Zero();
    server.link.deliver(kClient, {.session = kFirstId, .sequence = 1000}, bad);
  }
  SECTION("a sequence that no client reaches, of an update and of a control") {
    server.link.deliver(kClient, {.session = kFirstId, .sequence = kLargest}, planar_update(0));
    server.link.deliver(kClient, {.session = kFirstId, .sequence = kLargest}, Control{});
  }
  server.poll(0.2);
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 2}, Control{});
  server.deliver_update(3);
  const ServerSession::Inbox inbox = server.poll(0.3);
  REQUIRE(inbox.update != nullptr);
  CHECK(inbox.update->ve_time == 3);
  CHECK(inbox.control != nullptr);
}

TEST_CASE("A repeated part changes nothing of what the first one said") {
  Server server;
  server.begin();
  const Envelope envelope{.session = kFirstId, .sequence = 1};
  const ContactUpdate update = planar_update(20);
  ContactUpdate other = update;
  SECTION("whatever it says") { other.contacts[2].separation = 0.004; }
  SECTION("not even if it is wrong") { other.contacts[2].n_W.setZero(); }
  server.link.deliver(kClient, encode(envelope, update, 0));
  server.link.deliver(kClient, encode(envelope, other, 0));
  server.link.deliver(kClient, encode(envelope, update, 1));
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update != nullptr);
  CHECK(inbox.update->contacts[2].separation == update.contacts[2].separation);
  CHECK(server.session.statistics().total_dropped() == 1);
  CHECK(server.dropped(DropReason::kStale) == 1);
  CHECK(server.link.sent().empty());
}

TEST_CASE("An update is taken as it was sent, whatever came between its parts") {
  test::Random random;
  Server server;
  server.begin();
  int taken = 0;
  for (std::uint64_t newest = 3; newest <= 300; newest += 3) {
    struct Part {
      std::uint64_t sequence;
      std::size_t contacts;
      std::uint8_t part;
    };
    std::vector<Part> parts;
    for (std::uint64_t sequence = newest - 2; sequence <= newest; ++sequence) {
      const auto contacts = static_cast<std::size_t>(random.integer(0, 40));
      const std::uint8_t count = part_count(planar_update(contacts));
      for (std::uint8_t part = 0; part < count; ++part) {
        parts.push_back({sequence, contacts, part});
      }
    }
    std::shuffle(parts.begin(), parts.end(), random.engine());
    for (const auto& [sequence, contacts, part] : parts) {
      const Envelope envelope{.session = kFirstId, .sequence = sequence};
      const auto time = static_cast<double>(sequence);
      server.link.deliver(kClient, encode(envelope, planar_update(contacts, time), part));
      // One that says something else under the same number.
      if (random.integer(0, 2) == 0) {
        server.link.deliver(kClient, encode(envelope, planar_update(contacts, -time), part));
      }
      const ServerSession::Inbox inbox = server.poll(0.001 * time);
      if (inbox.update == nullptr) continue;
      ++taken;
      CHECK(inbox.update->ve_time == time);
      CHECK(inbox.update->contacts.size() == contacts);
      for (std::size_t i = 0; i < inbox.update->contacts.size(); ++i) {
        CHECK(inbox.update->contacts[i].identity == i);
        CHECK(inbox.update->contacts[i].p_WC.y() == time);
      }
    }
  }
  CHECK(taken >= 100);
  CHECK(server.dropped(DropReason::kMalformed) == 0);
}

TEST_CASE("A refused part of a newer update changes nothing of the one that is put together") {
  Server server;
  server.begin();
  const ContactUpdate update = planar_update(20, 1);
  ContactUpdate bad = planar_update(GENERATE(std::size_t{3}, std::size_t{20}, std::size_t{40}), 2);
  bad.contacts[2].n_W.setZero();
  server.link.deliver(kClient, encode({.session = kFirstId, .sequence = 1}, update, 0));
  server.link.deliver(kClient, encode({.session = kFirstId, .sequence = 2}, bad, 0));
  server.link.deliver(kClient, encode({.session = kFirstId, .sequence = 1}, update, 1));
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update != nullptr);
  CHECK(inbox.update->ve_time == 1);
  REQUIRE(inbox.update->contacts.size() == 20);
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK(inbox.update->contacts[i].identity == i);
    CHECK(inbox.update->contacts[i].p_WC == update.contacts[i].p_WC);
    CHECK(inbox.update->contacts[i].n_W == update.contacts[i].n_W);
  }
}

TEST_CASE("Parts that are good one by one and do not make one update are refused") {
  Server server;
  server.begin();
  const Envelope envelope{.session = kFirstId, .sequence = 1};
  server.link.deliver(kClient, encode(envelope, planar_update(20, 1), 0));
  server.link.deliver(kClient, encode(envelope, planar_update(20, 2), 1));
  const ServerSession::Inbox inbox = server.poll(0.1);
  CHECK(inbox.update == nullptr);
  CHECK(inbox.refused);
  CHECK(server.dropped(DropReason::kMalformed) == 2);
  CHECK(server.link.last_sent<Refusal>().error == UpdateError::kLayout);
}

TEST_CASE("A client learns why its update is refused, and ten times a second at most") {
  Server server;
  server.begin();
  ContactUpdate bad = planar_update(20);
  bad.contacts[13].n_W = {0, 0, 1.01};
  for (std::uint64_t sequence = 1; sequence <= 200; ++sequence) {
    server.link.deliver(kClient, {.session = kFirstId, .sequence = sequence}, bad);
    CHECK(server.poll(0.005 * static_cast<double>(sequence)).update == nullptr);
  }
  CHECK(server.link.sent().size() == Approx(10).margin(1));  // in 1 s
  const auto refusal = server.link.last_sent<Refusal>();
  CHECK(refusal.error == UpdateError::kNormal);
  CHECK(refusal.item == 13);
  CHECK(refusal.count > 100);
}

TEST_CASE("The caller learns that updates are refused and why, whatever is wrong with them") {
  Server server;
  server.begin();
  const ContactUpdate good = planar_update(2);
  const auto deliver = [&](const DatagramBytes& bytes) {
    server.link.deliver(kClient, bytes);
    return server.poll(0.1);
  };
  std::uint64_t sequence = 0;
  const auto next = [&] { return Envelope{.session = kFirstId, .sequence = ++sequence}; };
  DatagramBytes longer = encode(next(), good, 0);
  longer.push_back(std::byte{0});  // A stray byte at the end.
  CHECK(deliver(longer).refused);
  CHECK(server.session.refusal() == meaning_of(DropReason::kMalformed));

  ContactUpdate bad = good;
  bad.contacts[1].separation = std::nan("");
  CHECK(deliver(encode(next(), bad, 0)).refused);
  CHECK(server.session.refusal() == meaning_of(UpdateError::kNonFinite));

  CHECK(deliver(encode({.session = kFirstId, .sequence = 5000}, good, 0)).refused);
  CHECK_THAT(std::string(server.session.refusal()),
             Catch::Matchers::ContainsSubstring("1000 beyond"));

  server.link.deliver(kOther, longer);
  CHECK_FALSE(server.poll(0.1).refused);

  CHECK_FALSE(deliver(encode(next(), good, 0)).refused);
  CHECK(server.session.refusal().empty());
}

TEST_CASE("Refused updates keep no session alive") {
  Server server;
  server.begin(0);
  ContactUpdate bad = planar_update(0);
  bad.v_VE = Vector6::Zero();
  for (std::uint64_t sequence = 1; sequence <= 20; ++sequence) {
    server.link.deliver(kClient, {.session = kFirstId, .sequence = sequence}, bad);
    server.poll(0.1 * static_cast<double>(sequence));
  }
  server.say_hello(kOther, 2);
  CHECK(server.poll(2.05).hello != nullptr);
}

TEST_CASE("One wrong contact is left out and named, the others are taken") {
  Server server;
  server.begin();
  ContactUpdate update = planar_update(3);
  UpdateError error = UpdateError::kNone;
  SECTION("a link that the tool does not have") {
    update.contacts[1].a.index = 7;
    error = UpdateError::kSide;
  }
  SECTION("an identity that another has") {
    update.contacts[1].identity = 0;
    error = UpdateError::kDuplicate;
  }
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, update);
  REQUIRE(server.poll(0.1).update != nullptr);
  const auto refusal = server.link.last_sent<Refusal>();
  CHECK(refusal.error == error);
  CHECK_FALSE(refusal.whole);
  CHECK(refusal.item == 1);
  CHECK(refusal.count == 0);
}

TEST_CASE("Normals and quaternions off by what single precision leaves are made unit") {
  Server server;
  server.begin();
  ContactUpdate update = planar_update(1);
  update.contacts[0].n_W = Vector3(0, 0.6, 0.8) * (1 + 3e-6);
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, update);
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update != nullptr);
  CHECK((inbox.update->contacts[0].n_W - Vector3(0, 0.6, 0.8)).norm() < 1e-15);
}

TEST_CASE("The hold counts from the arrival of the update, not from the poll that takes it") {
  Server server;
  server.begin();
  server.link.set_waited(0.02);
  server.deliver_update(1);
  server.poll(0.1);
  server.session.acknowledge(0.101, test::planar_state());
  CHECK(server.link.last_sent<ProxyState>().hold == Approx(0.021).margin(1e-12));  // s
}

TEST_CASE("A poll that brings a hello or a goodbye brings no update of the session it ends") {
  Server server;
  server.begin();
  SECTION("hello") {
    server.say_hello(kClient, 2);
    server.deliver_update(2);
  }
  SECTION("goodbye") {
    server.deliver_update(1);
    server.link.deliver(kClient, {.session = kFirstId, .sequence = 2}, Goodbye{});
  }
  const ServerSession::Inbox inbox = server.session.poll(2 * kTimeout);
  CHECK((inbox.hello != nullptr || inbox.goodbye));
  CHECK(inbox.update == nullptr);
}

TEST_CASE("A flood neither stalls a poll nor keeps the update away for long") {
  Server server;
  server.begin();
  for (int i = 0; i < 1000; ++i) server.link.deliver(kOther, DatagramBytes(30, std::byte{7}));
  server.deliver_update(1);
  int polls = 0;
  std::size_t before = server.link.waiting();
  const ContactUpdate* update = nullptr;
  while (!update && polls < 100) {
    update = server.poll(0.001 * ++polls).update;
    CHECK(before - server.link.waiting() <= ServerSession::kDatagramsPerPoll);
    before = server.link.waiting();
  }
  CHECK(polls == 1001 / ServerSession::kDatagramsPerPoll + 1);
  CHECK(server.dropped(DropReason::kTruncated) == 1000);
}

TEST_CASE("A hello of another version is answered with both versions, garbage is not answered") {
  Server server;
  DatagramBytes hello = encode({}, planar_hello(99));
  hello[4] = std::byte{9};
  // What another version may have put elsewhere.
  for (std::size_t i = 7; i < 40; ++i) hello[i] = std::byte{0xEE};
  server.link.deliver(kClient, hello);
  server.poll(0);
  const auto reject = server.link.last_sent<Reject>();
  CHECK(reject.reason == RejectReason::kVersion);
  CHECK(reject.version == kProtocolVersion);
  CHECK(reject.nonce == 99);
  const std::string text(reject.text.begin(), reject.text.end());
  CHECK(text == "the server speaks version 2 of the protocol, the client version 9");

  server.link.forget_sent();
  DatagramBytes update = encode({.session = 7}, planar_update(0));
  update[4] = std::byte{9};
  server.link.deliver(kClient, update);
  server.link.deliver(kClient, DatagramBytes(1200, std::byte{0x48}));
  server.link.deliver(kClient, DatagramBytes{});
  server.poll(0.1);
  CHECK(server.link.sent().empty());
}

struct BadHello {
  const char* reason;  ///< What the client reads, or a part of it.
  void (*spoil)(Hello&);
};

const BadHello kBadHellos[] = {
    {"a tool must have at least one link", [](Hello& h) { h.tool.links.clear(); }},
    {"link 0: mass -1 kg must be 0 to 1000 kg", [](Hello& h) { h.tool.links[0].mass = -1; }},
    {"link 0: its joint moves too little: mass 0 kg must be at least 1e-06 kg",
     [](Hello& h) { h.tool.links[0].mass = 0; }},
    {"link 0: its joint moves too little: mass 5e-312 kg must be at least 1e-06 kg",
     [](Hello& h) { h.tool.links[0].mass = 5e-312; }},
    {"link 0: centre of mass must be finite and within ±10000 m",
     [](Hello& h) { h.tool.links[0].p_LCom.x() = 1e9; }},
    {"link 0: inertia must not be negative", [](Hello& h) { h.tool.links[0].I_LCom(0, 0) = -1; }},
    {"link 0: the root's parent must be the world (-1)",
     [](Hello& h) { h.tool.links[0].parent = 3; }},
    {"link 0: joint frame's quaternion must have length 1",
     [](Hello& h) { h.tool.links[0].X_PJ.R.w() = 2; }},
    {"hand link 7 must be 0 to 0", [](Hello& h) { h.tool.hand_link = 7; }},
    {"gravity must be finite and within ±100 m/s²", [](Hello& h) { h.tool.gravity_W.x() = 1e6; }},
    {"length -0.12345678901234568 m must be 1e-06 to 10000 m",
     [](Hello& h) { h.tool.length = -0.12345678901234568; }},
    {"initial configuration has 2 coordinates; the tool has 3",
     [](Hello& h) { h.q = Eigen::Vector2d(0, 0); }},
    {"initial configuration must be within ±", [](Hello& h) { h.q[0] = 1e9; }},
    {"VE rate 1e+09 Hz must be above 0 to 100000 Hz", [](Hello& h) { h.ve_rate = 1e9; }},
    {"epsilon 100 m must be 0 to 10 m", [](Hello& h) { h.epsilon = 100; }},
};

TEST_CASE("A hello that cannot be used is refused with the reason in words, and no allocation") {
  for (const BadHello& bad : kBadHellos) {
    INFO(bad.reason);
    Server server;
    Hello hello = planar_hello(3);
    bad.spoil(hello);
    server.link.deliver(kClient, {.sequence = 1}, hello);
    std::size_t allocations = 0;
    {
      const test::NoMalloc guard;
      REQUIRE(server.session.poll(0).hello == nullptr);
      allocations = guard.allocations();
    }
    CHECK(allocations == 0);
    const auto reject = server.link.last_sent<Reject>();
    CHECK(reject.reason == RejectReason::kTool);
    CHECK_THAT(std::string(reject.text.begin(), reject.text.end()), ContainsSubstring(bad.reason));
  }
}

TEST_CASE("The caller's refusal reaches the client, cut to what fits between characters") {
  Server server;
  server.say_hello(kClient, 3);
  REQUIRE(server.session.poll(0).hello != nullptr);
  std::string text(199, 'x');
  text += "·y";  // The dot takes bytes 199 and 200.
  server.session.reject(0, RejectReason::kTool, text);
  const auto reject = server.link.last_sent<Reject>();
  CHECK(std::string(reject.text.begin(), reject.text.end()) == std::string(199, 'x'));
  CHECK_FALSE(server.session.active());
}

TEST_CASE("An acknowledgement names the update, echoes its time and tells how long it was held") {
  Server server;
  server.begin();
  server.session.acknowledge(0, test::planar_state());
  CHECK(server.link.sent().empty());  // Nothing to acknowledge yet.

  server.link.deliver(kClient, {.session = kFirstId, .sequence = 9, .send_time = 123456789000},
                      planar_update(0));
  server.link.deliver(kOther, DatagramBytes{});
  server.poll(1.0);
  server.session.acknowledge(1.25, test::planar_state(1500));
  const auto state = server.link.last_sent<ProxyState>();
  CHECK(state.acknowledged == 9);
  CHECK(state.step == 1500);
  CHECK(state.update_send_time == Approx(123.456789).margin(1e-9));
  CHECK(state.hold == Approx(0.25).margin(1e-12));
  CHECK(state.dropped == 1);
  CHECK(server.link.sent_header(0).envelope.sequence == 2);
}

TEST_CASE("Closing says goodbye to the client and ends the session") {
  Server server;
  server.begin();
  server.session.close(1, GoodbyeReason::kShutdown);
  CHECK(server.link.last_sent<Goodbye>().reason == GoodbyeReason::kShutdown);
  CHECK_FALSE(server.session.active());
  server.link.forget_sent();
  server.session.close(1, GoodbyeReason::kShutdown);
  CHECK(server.link.sent().empty());
}

TEST_CASE("Each reason for a drop is counted as itself") {
  Server server;
  server.begin();
  const Envelope own{.session = kFirstId, .sequence = 10};
  const auto only = [&](DropReason reason, const Endpoint& peer, DatagramBytes bytes) {
    const ReceiveStatistics before = server.session.statistics();
    server.link.deliver(peer, bytes);
    server.poll(0.1);
    CAPTURE(name_of(reason));
    CHECK(server.session.statistics().total_dropped() == before.total_dropped() + 1);
    CHECK(server.dropped(reason) == before.count(reason) + 1);
  };
  DatagramBytes update = encode(own, planar_update(0));
  DatagramBytes cut = update;
  cut.pop_back();
  only(DropReason::kTruncated, kClient, cut);
  only(DropReason::kTruncated, kClient, {});
  DatagramBytes other = update;
  other[0] = std::byte{0};
  only(DropReason::kNotOurs, kClient, other);
  other = update;
  other[4] = std::byte{3};
  only(DropReason::kVersion, kClient, other);
  only(DropReason::kUnexpected, kClient, encode(own, test::planar_state()));
  only(DropReason::kForeignSession, kOther, update);
  ContactUpdate bad = planar_update(0);
  bad.ve_period = -1;
  only(DropReason::kMalformed, kClient, encode({kFirstId, 1, 0}, bad));
  bad = planar_update(0);
  bad.ve_time = std::numeric_limits<double>::quiet_NaN();
  only(DropReason::kNonFinite, kClient, encode({kFirstId, 2, 0}, bad));
  server.link.deliver(kClient, update);
  server.poll(0.1);
  only(DropReason::kStale, kClient, update);
  server.link.deliver(kClient, encode({kFirstId, 11, 0}, planar_update(20), 0));
  only(DropReason::kIncomplete, kClient, encode({kFirstId, 12, 0}, planar_update(0)));
}

TEST_CASE("Polling and acknowledging allocate nothing, whatever comes") {
  Server server;
  server.begin();
  std::size_t allocations = 0;
  std::uint64_t taken = 0;
  for (std::uint64_t sequence = 1; sequence <= 20; ++sequence) {
    server.deliver_update(sequence, kMaxContacts);
    server.say_hello(kOther, 2);
    server.say_hello(kClient, 1);
    server.link.deliver(kOther, DatagramBytes(1200, std::byte{0x48}));
    const test::NoMalloc guard;
    const ServerSession::Inbox inbox = server.session.poll(0.01);
    if (inbox.update) ++taken;
    server.session.acknowledge(0.01, test::planar_state());
    allocations += guard.allocations();
  }
  CHECK(taken == 20);
  CHECK(allocations == 0);
}

TEST_CASE("Refusing for the version, for a busy server and for the caller allocates nothing") {
  Server server;
  DatagramBytes hello = encode({.sequence = 1}, planar_hello(3), 0);
  hello[4] = std::byte{9};
  server.link.deliver(kClient, hello);
  const test::NoMalloc guard;
  server.session.poll(0);
  const std::size_t of_version = guard.allocations();
  CHECK(server.link.last_sent<Reject>().reason == RejectReason::kVersion);

  server.say_hello(kClient, 1);
  const std::size_t before = guard.allocations();
  const bool asked = server.session.poll(0).hello != nullptr;
  server.session.reject(0, RejectReason::kTool, "this tool is of no use here");
  const std::size_t of_caller = guard.allocations() - before;
  CHECK(asked);

  server.begin();
  server.say_hello(kOther, 2);
  const std::size_t alive = guard.allocations();
  server.session.poll(0.01);
  const std::size_t of_busy = guard.allocations() - alive;
  CHECK(server.link.last_sent<Reject>().reason == RejectReason::kBusy);
  CHECK(of_version + of_caller + of_busy == 0);
}

/// A session whose server takes scenes, or does not.
void begin_with_scenes(Server& server, double now = 0, bool scenes = true) {
  server.say_hello(kClient, 1);
  REQUIRE(server.session.poll(now).hello != nullptr);
  server.session.accept(now, {.capabilities = {.scenes = scenes}});
  server.link.forget_sent();
}

void deliver_chunk(Server& server, std::uint64_t sequence, std::uint64_t number,
                   const Endpoint& peer = kClient) {
  SceneChunk chunk;
  chunk.number = number;
  chunk.data.resize(3, static_cast<std::byte>(number));
  server.link.deliver(peer, {.session = server.session.id(), .sequence = sequence}, chunk);
}

/// First bytes of all chunks that wait, at most `most`.
std::vector<int> take_all(Server& server, std::size_t most = 1000) {
  std::vector<int> firsts;
  server.session.take_scene([&](std::span<const std::byte> data) {
    if (firsts.size() == most) return false;
    firsts.push_back(std::to_integer<int>(data[0]));
    return true;
  });
  return firsts;
}

TEST_CASE("Chunks of a scene come out in order, stay where they are not taken, and are told") {
  Server server;
  begin_with_scenes(server);
  CHECK_FALSE(server.session.has_scene());
  deliver_chunk(server, 1, 1);
  ServerSession::Inbox inbox = server.session.poll(0.1);
  CHECK(inbox.heard);
  CHECK_FALSE(inbox.scene);
  CHECK(server.session.has_scene());
  CHECK(take_all(server).empty());
  deliver_chunk(server, 2, 0);
  deliver_chunk(server, 3, 2);
  deliver_chunk(server, 4, 4);
  CHECK(server.session.poll(0.1).scene);
  CHECK(take_all(server, 2) == std::vector{0, 1});
  CHECK(server.session.poll(0.1).scene);
  SceneState state;
  state.shapes = 5;
  server.session.inform(0.1, state);
  const auto told = server.link.last_sent<SceneState>();
  CHECK((told.next == 2 && told.bitmap[0] == 0b101 && told.shapes == 5));
  CHECK(take_all(server) == std::vector{2});
  CHECK_FALSE(server.session.poll(0.1).scene);
  CHECK(server.session.statistics().total_dropped() == 0);
}

TEST_CASE("Chunks of another session or peer, that came before or too far ahead are dropped") {
  Server server;
  begin_with_scenes(server);
  deliver_chunk(server, 1, 0, kOther);
  server.link.deliver(kClient, {.session = 3}, SceneChunk{.number = 0, .data = {std::byte{1}}});
  CHECK_FALSE(server.session.poll(0.1).heard);
  CHECK(server.dropped(DropReason::kForeignSession) == 2);
  deliver_chunk(server, 1, 0);
  deliver_chunk(server, 2, 0);
  deliver_chunk(server, 3, kSceneWindow);
  deliver_chunk(server, 2000, 1);
  server.session.poll(0.1);
  CHECK(server.dropped(DropReason::kStale) == 1);
  CHECK(server.dropped(DropReason::kMalformed) == 2);
  CHECK_FALSE(server.session.poll(0.1).refused);
  CHECK(take_all(server) == std::vector{0});
}

TEST_CASE("A server that takes no scenes drops chunks as an older one does") {
  Server server;
  begin_with_scenes(server, 0, false);
  deliver_chunk(server, 1, 0);
  const ServerSession::Inbox inbox = server.session.poll(0.1);
  CHECK_FALSE((inbox.heard || inbox.scene || server.session.has_scene()));
  CHECK(server.dropped(DropReason::kUnexpected) == 1);
}

TEST_CASE("A session begins with an empty stream") {
  Server server;
  begin_with_scenes(server);
  deliver_chunk(server, 1, 0);
  deliver_chunk(server, 2, 5);
  CHECK(server.session.poll(0.1).scene);
  server.say_hello(kOther, 2);
  REQUIRE(server.session.poll(5).hello != nullptr);
  server.session.accept(5, {.capabilities = {.scenes = true}});
  CHECK_FALSE(server.session.has_scene());
  CHECK(take_all(server).empty());
  deliver_chunk(server, 1, 0, kOther);
  CHECK(server.session.poll(5.1).scene);
  CHECK(take_all(server) == std::vector{0});
}

TEST_CASE("A flood of chunks keeps an update away no longer than one of anything else") {
  Server server;
  begin_with_scenes(server);
  for (std::uint64_t i = 0; i < 1000; ++i) deliver_chunk(server, 1 + i % 900, i % 400);
  server.deliver_update(901);
  int polls = 0;
  std::size_t before = server.link.waiting();
  const ContactUpdate* update = nullptr;
  while (!update && polls < 100) {
    update = server.session.poll(0.001 * ++polls).update;
    CHECK(before - server.link.waiting() <= ServerSession::kDatagramsPerPoll);
    before = server.link.waiting();
  }
  CHECK(polls == 1001 / ServerSession::kDatagramsPerPoll + 1);
}

TEST_CASE("Chunks, and what is said of them, allocate nothing") {
  Server server;
  begin_with_scenes(server);
  for (std::uint64_t i = 0; i < 60; ++i) deliver_chunk(server, 1 + i, i);
  std::size_t taken = 0;
  const test::NoMalloc guard;
  server.session.poll(0.1);
  server.session.take_scene([&](std::span<const std::byte>) { return ++taken < 30; });
  server.session.inform(0.1, SceneState{});
  const std::size_t allocations = guard.allocations();
  CHECK(allocations == 0);
  CHECK(taken == 30);
}

TEST_CASE("An update with two poses of one body is used with the first, and the client hears it") {
  Server server;
  server.begin();
  ContactUpdate update = planar_update(1);
  update.poses.resize(3);
  update.poses[0].body = update.poses[2].body = 8;
  update.poses[0].X_WB.p.x() = 1;
  server.link.deliver(kClient, {.session = kFirstId, .sequence = 1}, update);
  const ServerSession::Inbox inbox = server.poll(0.1);
  REQUIRE(inbox.update);
  REQUIRE(inbox.update->poses.size() == 2);
  CHECK(inbox.update->poses[0].X_WB.p.x() == 1);
  const auto refusal = server.link.last_sent<Refusal>();
  CHECK((refusal.error == UpdateError::kDuplicate && !refusal.whole && refusal.item == 2));
}

TEST_CASE("Beginning a session allocates nothing") {
  Server server;
  server.say_hello(kClient, 1);
  const test::NoMalloc guard;
  const bool asked = server.session.poll(0).hello != nullptr;
  server.session.accept(0, {.servo_rate = 1000, .fingerprint = 5});
  const std::size_t allocations = guard.allocations();
  CHECK(asked);
  CHECK(allocations == 0);
}

}  // namespace
}  // namespace hlm::protocol
