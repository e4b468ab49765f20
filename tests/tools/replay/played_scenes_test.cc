// Scenes come into force in a replay in the ticks in which they did, however the loader's thread
// had worked.
#include "hlm/tools/replay/played_scenes.h"

#include <initializer_list>
#include <string>
#include <vector>

#include "hlm/haptic_server/journal.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using protocol::SceneCommit;
using protocol::ScenePlacement;
using protocol::SceneRecord;
using protocol::SceneRemoval;
using protocol::SceneShape;
using protocol::SceneShapeKind;

using Chunk = std::vector<std::uint8_t>;

ToolDescription tool() { return test::rigid_tool(1, Matrix3::Identity() * 1e-3); }

SceneShape ball(double radius = 0.1) {
  SceneShape shape{.kind = SceneShapeKind::kSphere, .size = {radius, 0, 0}};
  shape.hash = hash_of(shape);
  return shape;
}

ScenePlacement placement(std::uint32_t id, const SceneShape& shape = ball()) {
  return {.id = id, .shape = shape.hash};
}

Chunk chunk(std::initializer_list<SceneRecord> records) {
  Chunk bytes;
  for (const SceneRecord& record : records) append(record, bytes);
  return bytes;
}

/// A tick of the servo, as far as its scenes go.
SceneExchange tick(SceneSource& scenes, const std::vector<Chunk>& stream, std::size_t& next,
                   std::size_t most) {
  SceneExchange exchange;
  for (; most > 0 && next < stream.size(); --most, ++next, ++exchange.chunks) {
    if (!scenes.take(std::as_bytes(std::span(stream[next])))) break;
  }
  scenes.poll();
  exchange.number = scenes.number();
  return exchange;
}

/// A stream whose commits have 1 to some chunks, some of several commits.
std::vector<Chunk> random_stream(test::Random& random) {
  std::vector<Chunk> stream{chunk({ball()})};
  std::uint32_t commit = 0;
  for (std::uint32_t id = 1; id < 400; ++id) {
    if (random.integer(0, 2) > 0) stream.emplace_back();
    append(placement(id), stream.back());
    if (random.integer(0, 5) > 0) continue;
    commit += static_cast<std::uint32_t>(random.integer(1, 3));
    append(SceneCommit{commit}, stream.back());
  }
  return stream;
}

TEST_CASE(
    "However a loader worked, its scenes come again in the same ticks, with the same shapes") {
  test::Random random(test::random_seed());
  std::size_t scenes = 0;
  for (int run = 0; run < 6; ++run) {
    const std::vector<Chunk> stream = random_stream(random);
    SceneLoader loader;
    PlayedScenes played;
    loader.begin(tool());
    played.begin(tool());
    std::size_t next = 0;
    std::size_t next_played = 0;
    std::uint32_t before = 0;
    for (int i = 0; i < 400; ++i) {
      const auto most = static_cast<std::size_t>(random.integer(0, 12));
      // It works now and then: the ring of 256 is full at times.
      if (random.integer(0, run % 2 == 0 ? 2 : 60) == 0) loader.work();
      if (random.integer(0, 40) == 0) loader.drop({});
      const SceneExchange noted = tick(loader, stream, next, most);
      if (noted.number != before) ++scenes;
      before = noted.number;
      played.set(noted);
      CHECK(tick(played, stream, next_played, stream.size()) == noted);
      const Scene* const one = loader.poll();
      const Scene* const other = played.poll();
      REQUIRE((one == nullptr) == (other == nullptr));
      if (one != nullptr) CHECK(one->shapes() == other->shapes());
    }
    CHECK(played.missing().empty());
  }
  CHECK(scenes > 20);
}

TEST_CASE("A commit that the loader has passed over does no harm, even if it cannot be made") {
  const SceneShape thin = ball(1e-7);
  const std::vector<Chunk> stream{chunk({ball(), placement(1), SceneCommit{1}}),
                                  chunk({thin, placement(2, thin), SceneCommit{2}}),
                                  chunk({SceneRemoval{2}, SceneCommit{3}})};
  PlayedScenes played;
  played.begin(tool());
  std::size_t next = 0;
  played.set({.number = 1, .chunks = 1});
  CHECK(tick(played, stream, next, 3) == SceneExchange{1, 1});
  played.set({.number = 3, .chunks = 2});
  CHECK(tick(played, stream, next, 3) == SceneExchange{3, 2});
  CHECK(played.missing().empty());
}

TEST_CASE("A scene that cannot be made again is named with the reason, until the next session") {
  const SceneShape thin = ball(1e-7);
  const std::vector<Chunk> stream{chunk({ball(), placement(1), SceneCommit{1}}),
                                  chunk({thin, placement(2, thin), SceneCommit{2}})};
  PlayedScenes played;
  played.begin(tool());
  std::size_t next = 0;
  played.set({.number = 1, .chunks = 1});
  tick(played, stream, next, 2);
  CHECK(played.missing().empty());
  SECTION("what it is made of") {
    played.set({.number = 2, .chunks = 1});
    tick(played, stream, next, 2);
    CHECK_THAT(played.missing(), Catch::Matchers::StartsWith("scene 2: placement 2: "));
  }
  SECTION("chunks") {
    played.set({.number = 2, .chunks = 0});
    tick(played, stream, next, 2);
    CHECK(played.missing() == "scene 2: the recording lacks its commit, or a chunk before that");
  }
  CHECK(played.number() == 1);
  played.begin(tool());
  CHECK(played.missing().empty());
  CHECK(played.poll() == nullptr);
}

TEST_CASE(
    "A device's note has its gripper, by whose faults a session can end, and an older one none") {
  DeviceNote note;
  note.ratings.max_gripper_force = 8;
  note.ratings.gripper_travel = 0.025;
  const protocol::DatagramBytes bytes = encode(note);
  DeviceNote decoded;
  REQUIRE(decode(protocol::view(bytes), decoded));
  CHECK(decoded.ratings.max_gripper_force == 8);
  CHECK(decoded.ratings.gripper_travel == 0.025);
  REQUIRE(decode(protocol::view(bytes).first(bytes.size() - 2 * sizeof(double)), decoded = {}));
  CHECK(decoded.ratings.max_gripper_force == 0);
}

TEST_CASE("A tick's note says the scene and its chunks, and one without them says none") {
  TickNote note{.tick = 7, .scene = {.number = 3, .chunks = 5}};
  note.received.push_back(9);
  const protocol::DatagramBytes bytes = encode(note);
  TickNote decoded;
  REQUIRE(decode(protocol::view(bytes), decoded));
  CHECK(decoded.tick == 7);
  CHECK(decoded.scene == SceneExchange{3, 5});
  std::vector<int> last;
  constexpr std::size_t kScene = 8;  // Bytes; behind them, as of a newer server, four of warmth.
  constexpr std::size_t kWarm = 4;
  for (const std::byte byte : protocol::view(bytes).last(kScene + kWarm).first(kScene)) {
    last.push_back(static_cast<int>(byte));
  }
  CHECK(last == std::vector<int>{3, 0, 0, 0, 5, 0, 0, 0});
  // As older servers have written it.
  REQUIRE(decode(protocol::view(bytes).first(bytes.size() - kWarm), decoded));
  CHECK(decoded.scene == SceneExchange{3, 5});
  const auto older = protocol::view(bytes).first(bytes.size() - kWarm - kScene);
  REQUIRE(decode(older, decoded));
  CHECK(decoded.tick == 7);
  CHECK(decoded.received.size() == 1);
  CHECK(decoded.scene == SceneExchange{});
  CHECK_FALSE(decode(protocol::view(bytes).first(bytes.size() - 2), decoded));
}

}  // namespace
}  // namespace hlm::server
