// Scenes are made beside the loop: each session's newest, and nothing of a session before.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "hlm/haptic_server/scene/loader_thread.h"
#include "hlm/protocol/scene_records.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using protocol::SceneCommit;
using protocol::SceneError;
using protocol::ScenePlacement;
using protocol::SceneRecord;
using protocol::SceneRemoval;
using protocol::SceneShape;
using protocol::SceneShapeKind;

using Stream = std::vector<std::uint8_t>;

SceneShape ball(double radius = 0.1) {
  SceneShape shape{.kind = SceneShapeKind::kSphere, .size = {radius, 0, 0}};
  shape.hash = hash_of(shape);
  return shape;
}

ScenePlacement placement(std::uint32_t id, const SceneShape& shape, const ContactSide& side = {}) {
  return {.id = id, .shape = shape.hash, .side = side};
}

Stream stream(std::initializer_list<SceneRecord> records) {
  Stream bytes;
  for (const SceneRecord& record : records) append(record, bytes);
  return bytes;
}

/// A ball in the world, as scene 1.
Stream first_scene() { return stream({ball(), placement(1, ball()), SceneCommit{1}}); }

/// A loader as the loop has it, for a tool of one link; `work` is the other thread's.
class Loader {
 public:
  Loader() { begin(); }

  void begin() { loader_.begin(test::rigid_tool(1, Matrix3::Identity() * 1e-3)); }
  /// Hands the stream on in chunks. False if one was refused.
  bool take(const Stream& bytes, std::size_t chunk = protocol::kChunkSize) {
    const auto all = std::as_bytes(std::span(bytes));
    for (std::size_t taken = 0; taken < all.size(); taken += chunk) {
      if (!loader_.take(all.subspan(taken, std::min(chunk, all.size() - taken)))) return false;
    }
    return true;
  }
  /// The scene after all is read.
  Scene* make(const Stream& bytes, std::size_t chunk = protocol::kChunkSize) {
    REQUIRE(take(bytes, chunk));
    loader_.work();
    return loader_.poll();
  }
  std::string text() {
    const auto state = loader_.state();
    return {state.text.begin(), state.text.end()};
  }
  SceneLoader& operator*() { return loader_; }
  SceneLoader* operator->() { return &loader_; }

 private:
  SceneLoader loader_;
};

TEST_CASE("A stream in chunks of any size makes the scene of its number") {
  const auto chunk = static_cast<std::size_t>(GENERATE(1, 7, 100, 1024));
  Loader loader;
  CHECK(loader->poll() == nullptr);
  CHECK(loader->number() == 0);
  const Scene* const scene = loader.make(first_scene(), chunk);
  REQUIRE(scene != nullptr);
  CHECK(scene->shapes() == 1);
  CHECK(loader->number() == 1);
  const auto state = loader->state();
  CHECK(state.scene == 1);
  CHECK(state.received_scene == 1);
  CHECK(state.shapes == 1);
  CHECK(state.placements == 1);
  CHECK(state.error == SceneError::kNone);
}

TEST_CASE("Nothing is a scene before its commit, however much has come") {
  Loader loader;
  CHECK(loader.make(stream({ball(), placement(1, ball())})) == nullptr);
  CHECK(loader->state().placements == 1);
  CHECK(loader->state().received_scene == 0);
  CHECK(loader.make(stream({SceneCommit{5}})) != nullptr);
  CHECK(loader->number() == 5);
}

TEST_CASE("A later commit replaces the scene, and of two that come together the later one counts") {
  Loader loader;
  Scene* const first = loader.make(first_scene());
  REQUIRE(first != nullptr);
  const SceneShape larger = ball(0.2);
  Scene* const second = loader.make(stream({larger, placement(2, larger), SceneCommit{2}}));
  REQUIRE(second != nullptr);
  CHECK(second->shapes() == 2);
  CHECK(loader->number() == 2);
  Scene* const fourth = loader.make(stream({SceneRemoval{1}, SceneCommit{3}, placement(3, larger),
                                            placement(4, larger), SceneCommit{4}}));
  REQUIRE(fourth != nullptr);
  CHECK(fourth->shapes() == 3);
  CHECK(loader->number() == 4);
}

TEST_CASE("What was read alone is made later, and what is read meanwhile replaces it") {
  Loader loader;
  REQUIRE(loader.take(first_scene()));
  loader->read();
  CHECK(loader->poll() == nullptr);
  CHECK(loader->state().received_scene == 1);
  REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
  loader->read();
  loader->work();
  REQUIRE(loader->poll() != nullptr);
  CHECK(loader->number() == 2);
}

TEST_CASE("A scene stays in force while the next one is made, until the loop asks for it") {
  Loader loader;
  Scene* const first = loader.make(first_scene());
  REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
  CHECK(loader->poll() == first);
  loader->work();
  CHECK(loader->number() == 1);
  CHECK(first->shapes() == 1);  // It is there.
  CHECK(loader->poll() != nullptr);
  CHECK(loader->number() == 2);
  // Where the loop does not ask, the newest one replaces what waits.
  REQUIRE(loader.take(stream({placement(3, ball()), SceneCommit{3}})));
  loader->work();
  REQUIRE(loader.take(stream({placement(4, ball()), SceneCommit{4}})));
  loader->work();
  CHECK(loader->poll()->shapes() == 4);
}

TEST_CASE("The scene before is freed by the other thread, and the loop waits until it is") {
  Loader loader;
  // The parts of a shape live as long as a scene that has it.
  loader.make(first_scene());
  REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
  loader->work();
  REQUIRE(loader->poll()->shapes() == 2);  // The first one is given back now.
  // The other thread makes another one before it looks for what was given back: it does so first.
  REQUIRE(loader.take(stream({placement(3, ball()), SceneCommit{3}})));
  loader->work();
  CHECK(loader->poll()->shapes() == 3);
}

TEST_CASE("A fault in the stream is told, and the scene before stays") {
  struct Case {
    Stream bytes;
    SceneError error;
    std::uint32_t item;
    std::string text;
  };
  const SceneShape thin = ball(1e-7);
  const Case wrong = GENERATE_COPY(
      Case{stream({placement(9, ball(0.3)), SceneCommit{2}}), SceneError::kUnknownShape, 9,
           "placement 9"},
      Case{stream({SceneRemoval{8}}), SceneError::kUnknownPlacement, 8, "placement 8"},
      Case{stream({SceneCommit{1}}), SceneError::kOrder, 0, "commit 1"},
      Case{stream({placement(3, ball(), {SideKind::kToolLink, 1}), SceneCommit{2}}),
           SceneError::kSide, 3, "link 1"},
      // Found only when the scene is made.
      Case{stream({thin, placement(4, thin), SceneCommit{2}}), SceneError::kGeometry, 4,
           "placement 4: "},
      Case{{9, 1, 0, 0, 0, 0}, SceneError::kMalformed, 0, ""});
  Loader loader;
  Scene* const before = loader.make(first_scene());
  REQUIRE(before != nullptr);
  CHECK(loader.make(wrong.bytes) == before);
  CHECK(loader->number() == 1);
  const auto state = loader->state();
  CHECK(state.scene == 1);
  CHECK(state.error == wrong.error);
  CHECK(state.item == wrong.item);
  CHECK_THAT(loader.text(), Catch::Matchers::ContainsSubstring(wrong.text));
  // The rest of the stream counts for nothing.
  CHECK(loader.make(stream({placement(20, ball()), SceneCommit{30}})) == before);
  CHECK(loader->state().error == wrong.error);
}

/// A wavy floor of 722 triangles, a sheet: a piece for each side of them.
SceneShape floor_mesh() {
  SceneShape mesh{.kind = SceneShapeKind::kMesh};
  constexpr std::uint32_t kSide = 20;
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    mesh.vertices.emplace_back(i / kSide, i % kSide, (i / kSide + i % kSide) % 2);
  }
  for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
    for (std::uint32_t y = 0; y + 1 < kSide; ++y) {
      const std::uint32_t corner = x * kSide + y;
      mesh.triangles.push_back({corner, corner + kSide, corner + 1});
      mesh.triangles.push_back({corner + 1, corner + kSide, corner + kSide + 1});
    }
  }
  mesh.hash = hash_of(mesh);
  return mesh;
}

TEST_CASE("More pieces than a scene may have are refused, with how many there are") {
  const SceneShape mesh = floor_mesh();
  Loader loader;
  Stream records = stream({mesh});
  // Of a mesh that moves each triangle is a piece.
  const ContactSide body{SideKind::kMovableBody, 1};
  for (std::uint32_t i = 0; i < 42; ++i) append(placement(i, mesh, body), records);
  append(SceneCommit{1}, records);
  CHECK(loader.make(records) == nullptr);
  CHECK(loader->state().error == SceneError::kLimit);
  CHECK_THAT(loader.text(), Catch::Matchers::ContainsSubstring("60648 pieces"));
  CHECK_THAT(loader.text(), Catch::Matchers::ContainsSubstring("must be at most 60000"));
}

TEST_CASE("A thousand shapes in one place are refused, and the next session has its scene") {
  Loader loader;
  Stream records = stream({ball()});
  for (std::uint32_t i = 0; i < 1000; ++i) append(placement(i, ball()), records);
  append(SceneCommit{1}, records);
  CHECK(loader.make(records) == nullptr);
  CHECK(loader->state().error == SceneError::kGeometry);
  CHECK_THAT(loader.text(), Catch::Matchers::ContainsSubstring("must be at most 200 on the mean"));
  loader.begin();
  CHECK(loader.make(first_scene()) != nullptr);
}

TEST_CASE("A new session has no scene, no fault and nothing of the stream before") {
  Loader loader;
  REQUIRE(loader.make(first_scene()) != nullptr);
  SECTION("between two works") {}
  SECTION("with chunks on the way") {
    REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
  }
  SECTION("with a scene on the way") {
    REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
    loader->work();
  }
  SECTION("with a commit that is read and not made") {
    REQUIRE(loader.take(stream({placement(2, ball()), SceneCommit{2}})));
    loader->read();
  }
  SECTION("with half a record on the way") {
    Stream half = stream({placement(2, ball())});
    half.resize(half.size() / 2);
    REQUIRE(loader.make(half) != nullptr);
  }
  SECTION("after a fault") { REQUIRE(loader.make(stream({SceneRemoval{8}})) != nullptr); }
  SECTION("after another session, of which nobody heard") {
    loader.begin();
    REQUIRE(loader.take(stream({SceneRemoval{8}})));
  }
  loader.begin();
  CHECK(loader->poll() == nullptr);
  CHECK(loader->number() == 0);
  CHECK(loader->state().error == SceneError::kNone);
  CHECK(loader->state().received_scene == 0);
  loader->work();
  CHECK(loader->poll() == nullptr);
  CHECK(loader->state().placements == 0);
  Scene* const scene = loader.make(first_scene());
  REQUIRE(scene != nullptr);
  CHECK(scene->shapes() == 1);
  CHECK(loader->number() == 1);
}

TEST_CASE("A full ring refuses, and what comes again after the next work is not lost") {
  Loader loader;
  const Stream records = stream(
      {ball(), placement(1, ball()), placement(2, ball()), placement(3, ball()), SceneCommit{1}});
  REQUIRE(records.size() > 260);  // By bytes that is more than there is room for.
  const auto all = std::as_bytes(std::span(records));
  std::size_t taken = 0;
  while (loader->take(all.subspan(taken, 1))) ++taken;
  CHECK(taken == 256);
  CHECK_FALSE(loader->take(all.subspan(taken, 1)));
  loader->work();
  CHECK(loader->poll() == nullptr);
  for (; taken < all.size(); ++taken) REQUIRE(loader->take(all.subspan(taken, 1)));
  loader->work();
  REQUIRE(loader->poll() != nullptr);
  CHECK(loader->poll()->shapes() == 3);
}

TEST_CASE("The loop's calls allocate nothing and free nothing") {
  Loader loader;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  std::vector<Stream> scenes;
  for (std::uint32_t i = 1; i <= 20; ++i) {
    Stream records = i == 1 ? stream({ball()}) : Stream{};
    for (const SceneRecord& record :
         {SceneRecord(placement(i, ball())), SceneRecord(SceneCommit{i})}) {
      append(record, records);
    }
    scenes.push_back(records);
  }
  std::size_t allocations = 0;
  for (int session = 0; session < 2; ++session) {
    {
      const test::NoMalloc guard;
      loader->begin(tool);
      allocations += guard.allocations();
    }
    for (std::uint32_t i = 1; i <= 20; ++i) {
      {
        const test::NoMalloc guard;
        CHECK(loader->take(std::as_bytes(std::span(scenes[i - 1]))));
        allocations += guard.allocations();
      }
      loader->work();
      const test::NoMalloc guard;
      const bool is_new = loader->poll() != nullptr && loader->number() == i;
      const auto state = loader->state();
      allocations += guard.allocations();
      CHECK(is_new);
      CHECK(state.scene == i);
    }
  }
  CHECK(allocations == 0);
}

TEST_CASE("Two threads hand over hundreds of scenes of many sessions, each used while in force") {
  SceneLoader loader;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  const ContactSide of_tool{SideKind::kToolLink, 0};
  constexpr std::uint32_t kScenes = 20;
  std::size_t handovers = 0;
  std::size_t contacts = 0;
  std::size_t wrong = 0;
  {
    const SceneLoaderThread thread(loader);
    for (int session = 0; session < 30; ++session) {
      loader.begin(tool);
      std::uint32_t before = 0;
      // The first records of each session: a ball of the tool, which all touch.
      Stream records = stream({ball(), placement(1000, ball(), of_tool)});
      for (std::uint32_t i = 1; i <= kScenes; ++i) {
        append(placement(i, ball()), records);
        append(SceneCommit{i}, records);
        while (!loader.take(std::as_bytes(std::span(records)))) std::this_thread::yield();
        records.clear();
        // Some are replaced on the way, also by a new session.
        const bool waits = i % 4 != 0;
        do {
          Scene* const scene = loader.poll();
          const std::uint32_t number = loader.number();
          if (number < before || (scene == nullptr) != (number == 0)) ++wrong;
          if (number > before) ++handovers;
          before = number;
          if (scene != nullptr) {
            if (scene->shapes() != number + 1) ++wrong;
            scene->place(of_tool, Pose{});
            scene->forget();
            contacts += scene->of_tool(0.01).size();
          }
          if (loader.state().error != SceneError::kNone) ++wrong;
          std::this_thread::sleep_for(std::chrono::microseconds(200));
        } while (waits && before < i);
      }
    }
  }
  CHECK(wrong == 0);
  CHECK(handovers >= 450);
  CHECK(contacts > handovers);
}

/// Points all over a ball: all are corners of its hull.
SceneShape hull_of(int corners) {
  SceneShape hull{.kind = SceneShapeKind::kHull};
  const double turn = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < corners; ++i) {
    const double z = 1 - (2 * i + 1.0) / corners;
    const double r = 0.1 * std::sqrt(1 - z * z);
    hull.vertices.emplace_back(r * std::cos(turn * i), r * std::sin(turn * i), 0.1 * z);
  }
  hull.hash = hash_of(hull);
  return hull;
}

/// Within all limits; each pair of them has 8188 faces to be compared with as many.
Stream eighty_hulls() {
  const SceneShape hull = hull_of(4096);
  Stream records = stream({hull});
  for (std::uint32_t i = 0; i < 80; ++i) {
    ScenePlacement one = placement(i, hull);
    one.X_BS.p.x() = 1e-3 * i;
    append(one, records);
  }
  append(SceneCommit{1}, records);
  return records;
}

/// One that Qhull alone works on, which nothing interrupts.
Stream large_hull() {
  const SceneShape hull = hull_of(50'000);
  return stream({hull, placement(1, hull), SceneCommit{1}});
}

/// Triangles across each other: each has hundreds near it.
Stream soup() {
  SceneShape mesh{.kind = SceneShapeKind::kMesh};
  test::Random random(7);
  for (std::uint32_t i = 0; i < 16'000; ++i) {
    const Vector3 at = random.vector(0.2);
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(at + random.vector(0.02));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  mesh.hash = hash_of(mesh);
  return stream({mesh, placement(1, mesh), SceneCommit{1}});
}

/// Threads beside a loop that a test plays.
class LiveLoader {
 public:
  explicit LiveLoader(std::chrono::milliseconds longest = SceneLoaderThread::kLongestMaking)
      : threads_(std::make_unique<SceneLoaderThread>(loader_, longest)) {
    begin();
  }
  void begin() { loader_.begin(test::rigid_tool(1, Matrix3::Identity() * 1e-3)); }
  /// Until all of it is read.
  void give(const Stream& bytes) {
    auto left = std::as_bytes(std::span(bytes));
    while (!left.empty()) {
      const auto chunk = left.first(std::min(left.size(), protocol::kChunkSize));
      if (loader_.take(chunk)) {
        left = left.subspan(chunk.size());
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    REQUIRE(comes([&] { return loader_.state().received_scene == 1; }));
  }
  /// Whether it becomes true within a time, s, that is short beside what these scenes take.
  template <class Condition>
  bool comes(Condition condition) {
    constexpr double kWait = 20;
    return seconds_until(condition, kWait) < kWait;
  }
  template <class Condition>
  static double seconds_until(Condition condition, double most) {
    const auto begin = std::chrono::steady_clock::now();
    const auto passed = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    while (!condition() && passed() < most) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return passed();
  }
  void end() { threads_.reset(); }
  SceneLoader* operator->() { return &loader_; }

 private:
  SceneLoader loader_;
  std::unique_ptr<SceneLoaderThread> threads_;
};

TEST_CASE(
    "A new session has its scene while the one before still makes another, and so has the end") {
  const Stream slow = GENERATE(eighty_hulls(), large_hull(), soup());
  LiveLoader loader;
  const int wait = GENERATE(0, 100, 1000);  // ms: some other work of it.
  loader.give(slow);
  std::this_thread::sleep_for(std::chrono::milliseconds(wait));
  loader.begin();
  CHECK(loader->poll() == nullptr);
  loader.give(first_scene());
  CHECK(loader.comes([&] { return loader->poll() != nullptr; }));
  CHECK(loader->number() == 1);
  CHECK(loader->state().error == SceneError::kNone);
  // The same at the end.
  loader.begin();
  loader.give(slow);
  std::this_thread::sleep_for(std::chrono::milliseconds(wait));
  loader.end();
  // Left to themselves, they end, too.
  CHECK(loader.comes([] { return !SceneLoaderThread::leaves_any(); }));
}

TEST_CASE("A scene that takes too long to make is refused, with how long that may be") {
  LiveLoader loader(std::chrono::milliseconds(100));
  loader.give(eighty_hulls());
  REQUIRE(loader.comes([&] { return loader->state().error != SceneError::kNone; }));
  const auto state = loader->state();
  CHECK(state.error == SceneError::kLimit);
  const std::string text(state.text.begin(), state.text.end());
  CHECK_THAT(text, Catch::Matchers::ContainsSubstring("took more than 0.1 s to make"));
  loader.begin();
  loader.give(first_scene());
  CHECK(loader.comes([&] { return loader->poll() != nullptr; }));
}

}  // namespace
}  // namespace hlm::server
