// How much work contacts of a scene take in a tick, and what becomes of what there is no time for
// (docs/method.md 18.5).
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "hlm/geometry/work.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/heap.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using geometry::FinderCut;
using geometry::Work;
using test::Heap;
using test::Random;
using test::RandomHeap;

constexpr double kStep = 1e-3;  // s
constexpr ContactSide kWorld = Heap::kWorld;
constexpr ContactSide kTool = Heap::kTool;

/// What a tick's searches may do, units, and how much one piece may go beyond it.
constexpr std::uint64_t kWorkOfTick = 1'250'000;
constexpr double kBeyond = 1.3;

std::uint64_t work_of(const std::function<void()>& act) {
  const std::uint64_t before = Work::done();
  act();
  return Work::done() - before;
}

/// A free tool of 1 kg among what is heaped up.
struct Model {
  explicit Model(const Heap& heap)
      : scene(heap.shapes, {}, tool),
        model(std::make_unique<LocalModel>(tool, ToolModel(tool).neutral(), LocalModelParameters{},
                                           kStep)) {}

  ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  Scene scene;
  std::unique_ptr<LocalModel> model;
};

TEST_CASE("A tool of 56 boxes inside 56 others takes no more work than a tick allows") {
  Random random;
  CAPTURE(test::random_seed());
  Heap heap(random, 0, 0.1, 0.03);
  heap.add(kWorld, 56);
  heap.add(kTool, 56);
  Model m(heap);
  const std::uint64_t tried = work_of([&] { CHECK(m.model->try_scene(m.scene).pairs > 500); });
  CHECK(static_cast<double>(tried) < kBeyond * kWorkOfTick);
  m.model->set_scene(&m.scene);
  for (int i = 0; i < 20; ++i) {
    const std::uint64_t work = work_of([&] { m.model->step({}); });
    CHECK(static_cast<double>(work) < kBeyond * kWorkOfTick);
    CHECK(m.model->cut().pairs > 500);
    CHECK(m.model->velocity().allFinite());
  }
}

TEST_CASE("A scene of which nothing is left out is found as without a limit") {
  Random random;
  CAPTURE(test::random_seed());
  Heap heap(random, 0, 0.1, 0.3);
  heap.add(kWorld, 40);
  heap.shapes.push_back(heap.shapes.front());
  heap.shapes.back().side = kTool;
  Model m(heap);
  m.scene.place(kTool, Pose{{0.03, 0, 0}, Quaternion::Identity()});
  const auto found = m.scene.of_tool(0.02);
  const std::vector<geometry::FoundContact> all(found.begin(), found.end());
  REQUIRE_FALSE(all.empty());
  const auto limited = m.scene.of_tool(0.02, kWorkOfTick);
  CHECK(m.scene.cut() == FinderCut{});
  CHECK(std::equal(
      all.begin(), all.end(), limited.begin(), limited.end(),
      [](const auto& x, const auto& y) { return x.key == y.key && x.separation == y.separation; }));
}

TEST_CASE("Where a search is cut the pairs that overlap most come first from the next one on") {
  Random random;
  Heap heap(random, 0, 0.02, 0);
  constexpr int kPairs = 100;
  heap.add(kWorld, kPairs);
  heap.add(kTool, kPairs);
  for (int i = 0; i < kPairs; ++i) {  // In each place of a row two boxes overlap, by 0.05 to 5 mm.
    heap.shapes[static_cast<std::size_t>(i)].X_BS = {{0, 0.05 * i, 0}, Quaternion::Identity()};
    heap.shapes[static_cast<std::size_t>(kPairs + i)].X_BS = {
        {0.015 + 5e-5 * (i * 37 % kPairs), 0.05 * i, 0}, Quaternion::Identity()};
  }
  Model m(heap);
  m.scene.place(kTool, Pose{});
  constexpr std::uint64_t kWork = 90'000;
  m.scene.of_tool(1e-3, kWork);
  REQUIRE(m.scene.cut().pairs > 10);
  m.scene.forget();
  const auto found = m.scene.of_tool(1e-3, kWork);
  const std::size_t cut = m.scene.cut().pairs;
  REQUIRE(cut > 10);
  REQUIRE(found.size() > 10);
  // Four contacts of each of the deepest pairs.
  const auto pairs = static_cast<double>(geometry::kMaxSelected) / 4;
  for (const auto& contact : found) CHECK(-contact.separation > 5e-3 - 5e-5 * (pairs + 2.5));
}

TEST_CASE("A loaded contact that a cut search did not get to stays as a plane") {
  LocalContacts existing;
  LocalContact& loaded = existing.emplace_back();
  loaded.of_scene = true;
  loaded.identity = 5;
  loaded.frame_a = kFirstLinkFrame;
  loaded.frame_b = kWorldFrame;
  loaded.latest.loaded = true;
  existing.push_back(loaded);
  existing.back().identity = 6;
  existing.back().latest.loaded = false;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  const ToolModel proxy(tool);
  const LocalBodies bodies;
  const FramePoses poses = poses_of(proxy, bodies);
  UpdateFrames frames{.tool = proxy, .bodies = bodies, .reported = poses, .before = poses};
  frames.now = poses;
  for (const bool is_cut : {false, true}) {
    const auto updated = std::make_unique<LocalContacts>();
    renew_contacts(existing, {}, frames, {.is_known_in_part = is_cut}, {}, *updated);
    REQUIRE(updated->size() == (is_cut ? 1u : 0u));
    if (is_cut) CHECK((*updated)[0].identity == 5);
  }
}

TEST_CASE("However much overlaps, no search takes more work than a tick allows", "[optimised]") {
  Random random;
  CAPTURE(test::random_seed());
  for (int i = 0; i < 150; ++i) {
    const RandomHeap heap(random);
    std::unique_ptr<Model> m;
    try {
      m = std::make_unique<Model>(heap.heap);
    } catch (const std::length_error&) {
      continue;  // Refused as it is made: most of it lies in one place.
    }
    CAPTURE(i, heap.kind, heap.unit, heap.bodies.size());
    m->model->set_scene(&m->scene);
    for (int step = 0; step < 20; ++step) {
      HandInput hand;
      hand.F.head<3>() = random.vector(20);
      const std::uint64_t work = work_of([&] { m->model->step(hand); });
      REQUIRE(static_cast<double>(work) < kBeyond * kWorkOfTick);
      if (step % 7 != 1 || heap.bodies.empty()) continue;
      const std::uint64_t adopting = work_of([&] {
        m->model->adopt({.contacts = ReportedContacts(),
                         .q_VE = m->model->proxy().configuration(),
                         .bodies = heap.bodies,
                         .impulse_step = std::max(1.0, step - 6.0),
                         .period = 0.017,
                         .poses = heap.poses});
      });
      // Bodies are looked for at their reported place, and on the way from there.
      REQUIRE(static_cast<double>(adopting) < 2 * kBeyond * kWorkOfTick);
    }
    REQUIRE(m->model->velocity().allFinite());
  }
}

}  // namespace
}  // namespace hlm::server
