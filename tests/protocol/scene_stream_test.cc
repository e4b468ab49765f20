// The scene stream: both ends together over bad networks in virtual time, and each by itself.
#include "hlm/protocol/scene_stream.h"

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "hlm/protocol/client_session.h"
#include "hlm/protocol/server_session.h"
#include "hlm/protocol/transport/memory_network.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::protocol {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes random_bytes(std::size_t size, test::Random& random) {
  Bytes bytes(size);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.integer(0, 255));
  return bytes;
}

/// A server at 1000 Hz that takes scenes, and a client at 60 Hz that sends one.
class Pair {
 public:
  static constexpr std::size_t kBudget = 16;  // chunks in a frame: 8 Mbit/s

  explicit Pair(const protocol::LinkConditions& link, std::uint64_t seed)
      : network_(link, seed),
        server_(network_.server(), {.first_session_id = 5}),
        client_(network_.client(), {.server = protocol::MemoryNetwork::kServer,
                                    .hello = test::planar_hello(),
                                    .timeout = 4}) {}

  /// A tick, and a frame if it is time for one.
  void step() {
    const double now = this->now();
    network_.set_time(now);
    const ServerSession::Inbox request = server_.poll(now);
    if (request.hello) server_.accept(now, {.capabilities = {.scenes = true}});
    if (request.scene && takes) {
      server_.take_scene([this](std::span<const std::byte> data) {
        for (const std::byte byte : data) taken.push_back(std::to_integer<std::uint8_t>(byte));
        return true;
      });
    }
    if (request.update) {
      ++updates;
      server_.acknowledge(now, test::planar_state(static_cast<std::uint64_t>(ticks_)));
      if (server_.has_scene()) server_.inform(now, SceneState{});
    }
    if (ticks_++ % 17 == 0) frame(now);
  }
  void run(double duration) {
    for (double end = now() + duration; now() < end;) step();
  }
  /// Until there is a session.
  void connect() {
    while (!client_.active()) step();
  }
  double now() const { return 0.001 * ticks_; }
  ClientSession& client() { return client_; }
  ServerSession& server() { return server_; }
  protocol::MemoryNetwork& network() { return network_; }

  bool takes = true;  ///< Whether what has come is used.
  Bytes taken;
  int updates = 0;

 private:
  void frame(double now) {
    client_.poll(now);
    client_.send(now, test::planar_update(5, now));
    client_.send_scene(now, kBudget);
  }

  protocol::MemoryNetwork network_;
  ServerSession server_;
  ClientSession client_;
  int ticks_ = 1;
};

/// How long a megabyte takes to arrive, s. Fails unless it does so byte for byte.
double time_of_megabyte(const protocol::LinkConditions& link) {
  Pair pair(link, test::random_seed());
  test::Random random;
  const Bytes bytes = random_bytes(1'000'000, random);
  pair.connect();
  REQUIRE_FALSE(pair.client().queue_scene(bytes));
  const double begin = pair.now();
  constexpr double kPatience = 300;  // s
  while (pair.taken.size() < bytes.size() && pair.now() - begin < kPatience) pair.step();
  const double duration = pair.now() - begin;
  CHECK(std::ranges::equal(pair.taken, bytes));
  CHECK(pair.server().id() == 5);  // one session throughout
  pair.run(8 * link.delay + 5);
  CHECK(pair.client().scene_sender().waiting() == 0);
  CHECK(pair.taken.size() == bytes.size());
  const SceneSender& sender = pair.client().scene_sender();
  CHECK(sender.repeated() < sender.sent() / 2);
  return duration;
}

TEST_CASE("A megabyte crosses networks that lose, delay, reorder and duplicate, byte for byte") {
  struct Case {
    double loss;
    double delay;  // each way, s
    double most;   // s
  };
  // By half more than the slowest of ten seeds took.
  const Case one = GENERATE(Case{0, 0, 5}, Case{0, 0.1, 2}, Case{0, 0.5, 6}, Case{0.05, 0, 8},
                            Case{0.05, 0.1, 5}, Case{0.05, 0.5, 18}, Case{0.2, 0, 12},
                            Case{0.2, 0.1, 10}, Case{0.2, 0.5, 32});
  CAPTURE(one.loss, one.delay);
  const double duration = time_of_megabyte({.delay = one.delay,
                                            .jitter = 0.005,
                                            .loss = one.loss,
                                            .reordering = 0.02,
                                            .reorder_time = 0.03,
                                            .duplication = 0.02});
  CHECK(duration < one.most);
}

TEST_CASE("Updates go on while a scene is sent: of a good network each one is taken") {
  Pair pair({.delay = 0.02}, 1);
  test::Random random;
  pair.connect();
  pair.run(0.5);
  const int before = pair.updates;
  REQUIRE_FALSE(pair.client().queue_scene(random_bytes(1'000'000, random)));
  pair.run(1);
  CHECK(pair.updates - before >= 58);
  CHECK(pair.taken.size() > 500'000);
}

TEST_CASE("What a server does not take waits in the window, and is not sent again") {
  Pair pair({.delay = 0.02}, 1);
  test::Random random;
  const Bytes bytes = random_bytes(400'000, random);
  pair.connect();
  pair.takes = false;
  REQUIRE_FALSE(pair.client().queue_scene(bytes));
  pair.run(5);
  const SceneSender& sender = pair.client().scene_sender();
  CHECK(sender.sent() == kSceneWindow);
  CHECK(sender.repeated() == 0);
  CHECK(sender.first() == 0);
  CHECK(pair.client().scene_state().bitmap[3] == ~std::uint64_t{0});
  CHECK(pair.server().statistics().total_dropped() == 0);
  pair.takes = true;
  pair.run(5);
  CHECK(std::ranges::equal(pair.taken, bytes));
  CHECK(sender.waiting() == 0);
  CHECK(sender.repeated() == 0);
}

TEST_CASE("A network that goes for 3 s and comes back brings the rest of the scene") {
  Pair pair({.delay = 0.02}, 1);
  test::Random random;
  const Bytes bytes = random_bytes(1'000'000, random);
  pair.connect();
  REQUIRE_FALSE(pair.client().queue_scene(bytes));
  pair.run(0.4);
  pair.network().set_conditions({.delay = 0.02, .loss = 1});
  const std::uint64_t before = pair.client().scene_sender().sent();
  pair.run(3);
  // The window, and a few copies of it.
  CHECK(pair.client().scene_sender().sent() - before < 5 * kSceneWindow);
  pair.network().set_conditions({.delay = 0.02});
  pair.run(6);
  CHECK(std::ranges::equal(pair.taken, bytes));
}

TEST_CASE("Each loss halves what a sender sends, once in 0.1 s, and a second brings all back") {
  ScenePace pace;
  CHECK(pace.begin(0, 16) == 16);
  pace.arrived(0.02, 0, false);
  pace.lose(0.02, false);
  CHECK(pace.begin(0.02, 16) == 8);
  pace.lose(0.03, false);  // the same loss
  CHECK(pace.begin(0.03, 16) == 8);
  double now = 0.2;
  for (int i = 0; i < 20; ++i, now += 0.11) {
    pace.lose(now, false);
    pace.begin(now, 16);
  }
  pace.lose(now, false);
  CHECK(pace.begin(now, 16) <= 3);
  CHECK(pace.begin(now, 0) == 0);
  CHECK(pace.begin(now, 1) == 1);
  CHECK(pace.begin(now + 1, 16) == 16);
}

SceneChunk chunk_of(std::uint64_t number, std::size_t size = 3) {
  SceneChunk chunk;
  chunk.number = number;
  chunk.data.resize(size, static_cast<std::byte>(number));
  return chunk;
}

TEST_CASE("A receiver gives chunks out in order, and says what has come") {
  SceneReceiver receiver;
  CHECK_FALSE(receiver.has_begun());
  CHECK(receiver.front().empty());
  CHECK_FALSE(receiver.take(chunk_of(2)));
  CHECK_FALSE(receiver.take(chunk_of(255)));
  CHECK(receiver.front().empty());
  CHECK(receiver.has_begun());
  CHECK_FALSE(receiver.take(chunk_of(0)));
  SceneState state;
  receiver.describe(state);
  CHECK(state.next == 0);
  CHECK(state.bitmap == std::array<std::uint64_t, 4>{5, 0, 0, std::uint64_t{1} << 63u});
  REQUIRE(receiver.front().size() == 3);
  receiver.pop();
  CHECK(receiver.front().empty());
  CHECK(receiver.take(chunk_of(0)) == DropReason::kStale);
  CHECK(receiver.take(chunk_of(2)) == DropReason::kStale);
  CHECK(receiver.take(chunk_of(257)) == DropReason::kMalformed);
  CHECK(receiver.take(chunk_of(~std::uint64_t{0})) == DropReason::kMalformed);
  CHECK_FALSE(receiver.take(chunk_of(256)));
  CHECK_FALSE(receiver.take(chunk_of(1, kChunkSize)));
  CHECK(receiver.front().size() == kChunkSize);
  receiver.pop();
  CHECK(receiver.front()[0] == std::byte{2});
  receiver.restart();
  CHECK(receiver.front().empty());
  CHECK_FALSE(receiver.has_begun());
  receiver.describe(state);
  CHECK((state.next == 0 && state.bitmap == std::array<std::uint64_t, 4>{}));
}

TEST_CASE("A sender refuses more than it may hold, and what a server cannot have taken") {
  SceneSender sender;
  const Bytes bytes(SceneSender::kMostQueued / 4);
  for (int i = 0; i < 4; ++i) CHECK(sender.queue(bytes));
  CHECK_FALSE(sender.queue(Bytes(1)));
  CHECK(sender.waiting() == SceneSender::kMostQueued);
  std::size_t sent = 0;
  const auto count = [&](const SceneChunk& chunk) { CHECK(chunk.number == sent++); };
  CHECK(sender.send(0, 10, count) == 10);
  SceneState state;
  state.next = 11;
  CHECK_FALSE(sender.receive(0.1, state));
  CHECK(sender.first() == 0);
  state.next = 10;
  CHECK(sender.receive(0.1, state));
  CHECK(sender.first() == 10);
  CHECK(sender.waiting() == SceneSender::kMostQueued - 10 * kChunkSize);
  CHECK(sender.queue(Bytes(10)));
  state.next = 3;  // an older one
  CHECK(sender.receive(0.2, state));
  CHECK(sender.first() == 10);
  sender.restart();
  CHECK((sender.waiting() == 0 && sender.first() == 0));
}

TEST_CASE("A chunk that was sent is not changed by what is queued behind it") {
  SceneSender sender;
  REQUIRE(sender.queue(Bytes(3, 1)));
  std::vector<SceneChunk> chunks;
  const auto keep = [&](const SceneChunk& chunk) { chunks.push_back(chunk); };
  sender.send(0, 5, keep);
  REQUIRE(sender.queue(Bytes(3, 2)));
  REQUIRE(sender.queue(Bytes(3, 3)));
  CHECK(sender.send(0.1, 5, keep) == 1);
  REQUIRE(chunks.size() == 2);
  CHECK((chunks[0].number == 0 && chunks[0].data.size() == 3));
  CHECK((chunks[1].number == 1 && chunks[1].data.size() == 6));
  // Never heard of: sent again as it was.
  CHECK(sender.send(10, 5, keep) == 2);
  CHECK((chunks[2].number == 0 && chunks[2].data == chunks[0].data));
}

TEST_CASE("Neither end allocates while chunks are sent and come") {
  SceneSender sender;
  const auto receiver = std::make_unique<SceneReceiver>();
  REQUIRE(sender.queue(Bytes(100'000)));
  const test::NoMalloc guard;
  double now = 0;
  while (sender.waiting() > 0 && now < 10) {
    now += 0.01;
    int place = 0;
    sender.send(now, 16, [&](const SceneChunk& chunk) {
      if (++place % 3 != 0 || now > 1) static_cast<void>(receiver->take(chunk));
    });
    for (; !receiver->front().empty(); receiver->pop()) {
    }
    SceneState state;
    receiver->describe(state);
    sender.receive(now, state);
  }
  CHECK(guard.allocations() == 0);
  CHECK(sender.waiting() == 0);
}

}  // namespace
}  // namespace hlm::protocol
