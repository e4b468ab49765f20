// How much work contacts of a scene take in a tick, and what becomes of what there is no time for
// (docs/method.md 18.5).
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "hlm/geometry/work.h"
#include "hlm/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using geometry::FinderCut;
using geometry::Work;
using test::Random;

constexpr double kStep = 1e-3;  // s
constexpr ContactSide kWorld{SideKind::kWorld, 0};
constexpr ContactSide kTool{SideKind::kToolLink, 0};

/// What a tick's searches may do, units, and how much one piece may go beyond it.
constexpr std::uint64_t kWorkOfTick = 500'000;
constexpr double kBeyond = 1.3;

std::uint64_t work_of(const std::function<void()>& act) {
  const std::uint64_t before = Work::done();
  act();
  return Work::done() - before;
}

geometry::AnyShape random_shape(Random& random, int kind, double size) {
  switch (kind) {
    case 0:
      return geometry::Shape(geometry::Box{Vector3::Constant(size)});
    case 1:
      return geometry::Shape(geometry::Cylinder{size / 2, size});
    case 2: {
      geometry::Hull hull;
      for (int i = random.integer(8, 300); i > 0; --i) {
        hull.vertices.push_back(size / 2 * random.direction());
      }
      return geometry::Shape(hull);
    }
    case 3:
      return geometry::Shape(geometry::Ellipsoid{{size / 2, size / 3, size / 4}});
    case 4:
      return geometry::Shape(geometry::Capsule{size / 4, size});
    default:
      return geometry::Shape(geometry::Sphere{size / 2});
  }
}

/// Shapes of one size, turned and moved at random about one place.
class Heap {
 public:
  Heap(Random& random, int kind, double size, double spread)
      : random_(random), kind_(kind), size_(size), spread_(spread) {}

  void add(const ContactSide& side, int count) {
    for (int i = 0; i < count; ++i) {
      const auto shape = random_shape(random_, kind_, size_);
      shapes.push_back(
          {.shape = std::make_shared<const geometry::ShapeParts>(parts_of(shape, "of the test")),
           .side = side,
           .X_BS = {random_.vector(spread_), rotation_from_vector(3 * random_.direction())}});
    }
  }

  std::vector<PlacedShape> shapes;

 private:
  Random& random_;
  int kind_;
  double size_;    ///< m.
  double spread_;  ///< m, to each side.
};

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
  Heap heap(random, 3, 0.02, 0);
  constexpr int kPairs = 100;
  heap.add(kWorld, kPairs);
  heap.add(kTool, kPairs);
  for (int i = 0; i < kPairs;
       ++i) {  // In each place of a row two ellipsoids overlap, by 0.05 to 5 mm.
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
  for (const auto& contact : found) {
    CHECK(-contact.separation >
          5e-5 * (static_cast<double>(cut) - 1));  // The others are less deep.
  }
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
    const auto updated = std::make_unique<ToolContacts>();
    renew_contacts(existing, {}, frames, {.is_known_in_part = is_cut}, {}, *updated);
    REQUIRE(updated->acting.size() == (is_cut ? 1u : 0u));
    if (is_cut) CHECK(updated->acting[0].identity == 5);
  }
}

TEST_CASE("However much overlaps, no search takes more work than a tick allows", "[optimised]") {
  Random random;
  CAPTURE(test::random_seed());
  for (int i = 0; i < 150; ++i) {
    const double unit = random.integer(0, 3) == 0 ? 1000 : 1;  // Millimetres for metres.
    const int kind = random.integer(0, 5);
    Heap heap(random, kind, 0.1 * unit, unit * 0.3 * std::pow(10, random.uniform(-2, 0)));
    heap.add(kWorld, random.integer(1, 90));
    heap.add(kTool, random.integer(1, 90));
    const int count = random.integer(0, 2) == 0 ? random.integer(1, 8) : 0;
    MovableBodies bodies;
    BodyPoses poses;
    for (int id = 0; id < count; ++id) {
      heap.add({SideKind::kMovableBody, static_cast<std::uint32_t>(id)}, random.integer(1, 20));
      MovableBody& body = bodies.emplace_back();
      body.id = static_cast<std::uint32_t>(id);
      body.W.diagonal() << Vector3::Constant(3), Vector3::Constant(3000);
      poses.push_back({.body = body.id, .X_WB = {body.p_WCom, Quaternion::Identity()}});
    }
    std::unique_ptr<Model> m;
    try {
      m = std::make_unique<Model>(heap);
    } catch (const std::length_error&) {
      continue;  // Refused as it is made: most of it lies in one place.
    }
    CAPTURE(i, kind, unit, count);
    m->model->set_scene(&m->scene);
    for (int step = 0; step < 20; ++step) {
      HandInput hand;
      hand.F.head<3>() = random.vector(20);
      const std::uint64_t work = work_of([&] { m->model->step(hand); });
      REQUIRE(static_cast<double>(work) < kBeyond * kWorkOfTick);
      if (step % 7 != 1 || count == 0) continue;
      const std::uint64_t adopting = work_of([&] {
        m->model->adopt({.contacts = ReportedContacts(),
                         .q_VE = m->model->proxy().configuration(),
                         .bodies = bodies,
                         .impulse_step = std::max(1.0, step - 6.0),
                         .period = 0.017,
                         .poses = poses});
      });
      // Bodies are looked for at their reported place, and on the way from there.
      REQUIRE(static_cast<double>(adopting) < 2 * kBeyond * kWorkOfTick);
    }
    REQUIRE(m->model->velocity().allFinite());
  }
}

}  // namespace
}  // namespace hlm::server
