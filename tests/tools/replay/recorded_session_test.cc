// What a capture holds becomes sessions, whatever else passed and in whatever order.
#include "hlm/tools/replay/recorded_session.h"

#include <stdexcept>
#include <string>

#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/transport/capture.h"
#include "tests/protocol/sample_messages.h"
#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using protocol::Endpoint;
using protocol::view;
using test::planar_hello;
using test::planar_state;
using test::planar_update;

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr Endpoint kOther{.address = 0x0A000003, .port = 50000};
constexpr std::size_t kManyContacts = 40;  // more than two datagrams hold
const int kParts = part_count(planar_update(kManyContacts));

/// A capture as the test writes it, a millisecond between datagrams.
class Capture {
 public:
  void pass(const Endpoint& from, const Endpoint& to, std::span<const std::byte> bytes) {
    writer_.write(time_ns_ += 1'000'000, from, to, bytes);
  }
  template <class Message>
  void pass(const Endpoint& from, const Endpoint& to, std::uint64_t session, std::uint64_t sequence,
            const Message& message, std::uint8_t part = 0) {
    pass(from, to,
         view(protocol::encode({.session = session, .sequence = sequence}, message, part)));
  }
  void begin(std::uint64_t session, const Endpoint& client = kClient) {
    pass(client, kServer, 0, session, planar_hello(session));
    pass(kServer, client, session, 1, protocol::Welcome{.nonce = session, .fingerprint = 77});
  }
  void update(std::uint64_t session, std::uint64_t sequence) {
    pass(kClient, kServer, session, sequence, planar_update(0));
  }
  /// One of kParts parts of a larger update.
  void part(std::uint64_t session, std::uint64_t sequence, int number) {
    pass(kClient, kServer, session, sequence, planar_update(kManyContacts),
         static_cast<std::uint8_t>(number));
  }
  void state(std::uint64_t session, std::uint64_t acknowledged) {
    protocol::ProxyState state = planar_state();
    state.acknowledged = acknowledged;
    pass(kServer, kClient, session, 1 + acknowledged, state);
  }

  std::vector<RecordedSession> sessions() {
    writer_.flush();
    return read_sessions(path_);
  }
  RecordedSession only_session() {
    const std::vector<RecordedSession> all = sessions();
    REQUIRE(all.size() == 1);
    return all.front();
  }
  std::string error() {
    writer_.flush();
    try {
      read_sessions(path_);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no error";
  }
  std::string path() const { return path_.string(); }

 private:
  test::TemporaryDirectory directory_;
  std::filesystem::path path_ = directory_ / "run.pcap";
  protocol::CaptureWriter writer_{path_};
  std::int64_t time_ns_ = 0;
};

std::vector<std::uint64_t> sequences(const RecordedSession& session) {
  std::vector<std::uint64_t> all;
  for (const RecordedUpdate& update : session.updates) all.push_back(update.sequence);
  return all;
}

bool is_whole(const RecordedUpdate& update) {
  protocol::ContactUpdate decoded;
  return !decode(update.parts, decoded);
}

TEST_CASE("A capture of another version of the protocol is refused with both versions") {
  Capture capture;
  protocol::DatagramBytes bytes = protocol::encode({}, planar_hello(1));
  bytes[4] = std::byte{1};  // version
  capture.pass(kClient, kServer, view(bytes));
  CHECK(capture.error() ==
        capture.path() + ": holds version 1 of the protocol; this program replays version 2");
}

TEST_CASE("A capture of sealed datagrams is refused with the way to one that is opened") {
  Capture capture;
  protocol::DatagramBytes packet = protocol::sealed_header(1, 2);
  packet.resize(100);
  capture.pass(kClient, kServer, view(packet));
  CHECK_THROWS_WITH(capture.sessions(), Catch::Matchers::ContainsSubstring("sealed") &&
                                            Catch::Matchers::ContainsSubstring("--record"));
}

TEST_CASE("A session is its hello, welcome, updates, controls and acknowledgements") {
  Capture capture;
  capture.begin(5);
  capture.pass(kClient, kServer, 5, 1, protocol::Control{.telemetry = true, .X_WTarget = {}});
  capture.update(5, 2);
  capture.state(5, 2);
  for (int i = 0; i < kParts; ++i) capture.part(5, 3, i);
  capture.state(5, 3);
  const RecordedSession session = capture.only_session();
  CHECK(session.id == 5);
  CHECK(session.client == kClient);
  CHECK(session.hello.q == planar_hello().q);
  CHECK(session.hello_parts.size() == 1);
  CHECK(session.welcome.fingerprint == 77);
  CHECK(sequences(session) == std::vector<std::uint64_t>{2, 3});
  CHECK(session.updates[1].time_ns - session.updates[0].time_ns == 2'000'000);
  CHECK(is_whole(session.updates[0]));
  CHECK(is_whole(session.updates[1]));
  CHECK(session.controls.size() == 1);
  CHECK(session.controls.contains(1));
  REQUIRE(session.acknowledgements.size() == 2);
  CHECK(session.acknowledgements[1].acknowledged == 3);
}

TEST_CASE("Parts that came twice, in another order or among those of the next update are one") {
  Capture capture;
  capture.begin(5);
  REQUIRE(kParts > 2);
  for (int i = kParts; i-- > 0;) capture.part(5, 1, i);
  capture.part(5, 2, 0);
  capture.part(5, 1, 0);  // a late copy
  for (int i = 1; i < kParts; ++i) capture.part(5, 2, i);
  const RecordedSession session = capture.only_session();
  CHECK(sequences(session) == std::vector<std::uint64_t>{1, 2});
  for (const RecordedUpdate& update : session.updates) CHECK(is_whole(update));
}

TEST_CASE("An update of which a part is missing is kept as it is") {
  Capture capture;
  capture.begin(5);
  for (int i = 0; i < kParts; ++i) {
    if (i != 1) capture.part(5, 1, i);
  }
  capture.update(5, 2);
  const RecordedSession session = capture.only_session();
  CHECK(sequences(session) == std::vector<std::uint64_t>{1, 2});
  CHECK_FALSE(is_whole(session.updates[0]));
  CHECK(is_whole(session.updates[1]));
}

TEST_CASE("Sessions of two clients at a time, and of one after another, stay apart") {
  Capture capture;
  capture.begin(5);
  capture.begin(6, kOther);
  capture.update(5, 1);
  capture.update(6, 1);
  capture.update(5, 2);
  capture.begin(7);
  capture.update(7, 1);
  const std::vector<RecordedSession> sessions = capture.sessions();
  REQUIRE(sessions.size() == 3);
  CHECK(sessions[0].id == 5);
  CHECK(sequences(sessions[0]) == std::vector<std::uint64_t>{1, 2});
  CHECK(sessions[1].id == 6);
  CHECK(sessions[1].client == kOther);
  CHECK(sequences(sessions[1]).size() == 1);
  CHECK(sessions[2].hello.nonce == 7);
}

TEST_CASE("A repeated hello, welcome or acknowledgement counts once") {
  Capture capture;
  capture.begin(5);
  capture.begin(5);
  capture.update(5, 1);
  capture.state(5, 1);
  capture.state(5, 1);
  capture.update(5, 2);
  capture.state(5, 2);
  capture.state(5, 1);
  const RecordedSession session = capture.only_session();
  CHECK(session.hello_parts.size() == 1);
  CHECK(session.acknowledgements.size() == 2);
}

TEST_CASE("What is of no granted session or of no protocol is skipped") {
  Capture capture;
  const std::string noise = "GET / HTTP/1.1";
  capture.pass(kOther, kServer, std::as_bytes(std::span(noise)));
  capture.pass(kServer, kOther, 9, 1, protocol::Welcome{.nonce = 9});  // its hello came before
  capture.update(9, 1);
  capture.begin(5);
  capture.update(8, 1);
  capture.pass(kServer, kClient, 5, 2, protocol::Goodbye{});
  const RecordedSession session = capture.only_session();
  CHECK(session.id == 5);
  CHECK(session.updates.empty());
}

TEST_CASE("An acknowledgement of a step to which no server can have come is skipped") {
  Capture capture;
  capture.begin(5);
  capture.update(5, 1);
  capture.state(5, 1);
  protocol::ProxyState state = planar_state(std::uint64_t{1} << 60);
  state.acknowledged = 2;
  capture.pass(kServer, kClient, 5, 9, state);
  CHECK(capture.only_session().acknowledgements.size() == 1);
}

TEST_CASE("A capture without a session is refused by name") {
  Capture capture;
  capture.pass(kClient, kServer, 0, 1, planar_hello(1));
  CHECK(capture.error() == capture.path() + ": holds no session: a hello and its welcome");
  CHECK_THROWS_AS(read_sessions("/nowhere/run.pcap"), std::runtime_error);
}

}  // namespace
}  // namespace hlm::server
