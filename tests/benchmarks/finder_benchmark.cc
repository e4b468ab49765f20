// What does the search of the tool cost at each tick: in the shipped scenes, on a terrain of
// triangles, and among ten thousand boxes?
//
// Each line: `cold`, the tool comes from elsewhere; `next`, it has moved as in one tick. Of the
// searches at random poses near touch the median, those at 90 % and 99.9 %, and the longest, µs;
// each is the shortest of a few, for others use the machine, too.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "hlm/geometry/contact_finder.h"
#include "hlm/geometry/mesh_pieces.h"
#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/scene/scene.h"
#include "tests/support/near_touch.h"

namespace hlm::test {
unsigned random_seed() { return 1; }
}  // namespace hlm::test

namespace hlm::ve {
namespace {

using namespace geometry;
using namespace test;

constexpr double kEpsilon = 0.002;  // m
constexpr double kTick = 0.0003;    // m: how far the tool moves in a tick of 1 ms, at 0.3 m/s.
constexpr double kNear = 0.3;       // m: poses are no farther from where the tool is at first.
constexpr int kPoses = 300;
constexpr int kTicks = 8;
constexpr int kRuns = 5;

/// A tool that can be put anywhere, rigid, among pieces.
struct Ground {
  const Pieces& pieces;
  std::vector<ContactFinder::Body> bodies;
  std::vector<int> tool;    ///< Its bodies.
  std::vector<Pose> X_WB;   ///< Poses of all bodies at first.
  bool planar = false;      ///< Moves parallel to xy alone.
  std::size_t targets = 0;  ///< All bodies that are touched.
};

Pose X_WG(const Ground& ground, const Piece& piece) {
  if (ground.pieces.is_fixed(piece.id.body)) return piece.X_FG;
  return ground.X_WB[static_cast<std::size_t>(piece.id.body)] * piece.X_FG;
}

/// How the tool is moved from where it was at first for any of its pieces to touch any other one,
/// and the direction out of that.
std::pair<Pose, Vector3> random_motion(const Ground& ground, Random& random) {
  const int own_body = ground.tool[static_cast<std::size_t>(
      random.integer(0, static_cast<int>(ground.tool.size()) - 1))];
  const auto own = ground.pieces.of(own_body);
  const auto other = ground.pieces.of(random.integer(0, static_cast<int>(ground.targets) - 1));
  const bool none =
      own.empty() || other.empty() || std::ranges::count(ground.tool, other.front().id.body) > 0;
  if (none) return random_motion(ground, random);
  const auto any = [&](std::span<const Piece> of) -> const Piece& {
    return of[static_cast<std::size_t>(random.integer(0, static_cast<int>(of.size()) - 1))];
  };
  const Piece& target = any(other);
  const Piece& piece = any(own);
  const Pose X_WO = X_WG(ground, target);
  const SurfacePoint at_O = point_on(target, random);
  SurfacePoint at_W{X_WO * at_O.p, X_WO.R * at_O.n};
  Pose motion{Vector3::Zero(), rotation_from_vector(random.vector(0.5))};
  if (random.integer(0, 3) == 0) motion.R = random.rotation();
  if (ground.planar) {
    at_W.n.z() = 0;
    motion.R = rotation_from_vector(Vector3(0, 0, random.uniform(-3, 3)));
    at_W.n.normalize();
  }
  if ((at_W.p - X_WG(ground, piece).p).norm() > kNear) return random_motion(ground, random);
  motion.p =
      way_to(at_W, 0.001 * random.uniform(-1, 1), *piece.convex, motion * X_WG(ground, piece));
  if (ground.planar) motion.p.z() = 0;
  return {motion, at_W.n};
}

double percentile(const std::vector<double>& sorted, double share) {
  const auto last = static_cast<double>(sorted.size() - 1);
  return sorted[static_cast<std::size_t>(std::ceil(share * last))];
}

void report(benchmark::State& state, const std::string& name, std::vector<double> times) {
  std::ranges::sort(times);
  state.counters[name + "_50"] = percentile(times, 0.5);
  state.counters[name + "_90"] = percentile(times, 0.9);
  state.counters[name + "_99.9"] = percentile(times, 0.999);
  state.counters[name + "_max"] = times.back();
}

/// Times the searches at random poses.
class Timed {
 public:
  explicit Timed(const Ground& ground)
      : ground_(ground),
        finder_(ground.pieces, ground.bodies,
                [bodies = ground.bodies](const CollisionId&, const CollisionId& b) {
                  return bodies[static_cast<std::size_t>(b.body)].link < 0;
                }) {
    for (std::size_t i = 0; i < ground.X_WB.size(); ++i) {
      finder_.place(static_cast<int>(i), ground.X_WB[i]);
    }
  }

  void run(benchmark::State& state) {
    Random random;
    std::vector<Pose> motions;
    while (motions.size() < kPoses) {
      const auto motion = near_touch(random);
      if (motion) motions.push_back(*motion);
    }
    std::vector<double> cold(kPoses, 1e9);
    std::vector<double> next(kPoses * kTicks, 1e9);
    for (int run = 0; run < kRuns; ++run) {
      contacts_ = 0;
      for (std::size_t pose = 0; pose < kPoses; ++pose) {
        Pose motion = motions[pose];
        cold[pose] = std::min(cold[pose], search(motion));
        const Vector3 way = kTick * Vector3(random.direction().cwiseProduct(
                                        ground_.planar ? Vector3(1, 1, 0) : Vector3(1, 1, 1)));
        for (std::size_t tick = 0; tick < kTicks; ++tick) {
          motion.p += (tick % 4 < 2 ? 1 : -1) * way;  // It stays near touch.
          double& least = next[pose * kTicks + tick];
          least = std::min(least, search(motion));
        }
      }
    }
    state.SetIterationTime(1e-6 * percentile(cold, 0.5));
    report(state, "cold", cold);
    report(state, "next", next);
    const double searches = kRuns * kPoses * (kTicks + 1);
    state.counters["queries"] = static_cast<double>(finder_.statistics().queries) / searches;
    state.counters["contacts"] = static_cast<double>(contacts_) / (kPoses * (kTicks + 1));
  }

 private:
  void place(const Pose& motion) {
    for (const int body : ground_.tool) {
      finder_.place(body, motion * ground_.X_WB[static_cast<std::size_t>(body)]);
    }
  }

  /// Whether a piece of the tool is deep in another one, whatever the surface there: a tool that
  /// was led out of the inside of things.
  bool is_deep(const Pose& motion) const {
    constexpr double kDeep = 0.002;  // m
    ProximityStatistics statistics;
    for (const int body : ground_.tool) {
      for (const Piece& own : ground_.pieces.of(body)) {
        const Pose X_WO = motion * X_WG(ground_, own);
        const auto box = own.convex->bounds(X_WO);
        for (std::size_t i = 0; i < ground_.targets; ++i) {
          if (ground_.bodies[i].link >= 0) continue;
          for (const Piece& piece : ground_.pieces.of(static_cast<int>(i))) {
            const Pose X = X_WG(ground_, piece);
            if (!box.intersects(piece.convex->bounds(X))) continue;
            for (const ManifoldPoint& point :
                 find_contacts(*own.convex, X_WO, *piece.convex, X, 0, statistics)) {
              if (point.separation < -kDeep) return true;
            }
          }
        }
      }
    }
    return false;
  }

  /// Leads the tool from outside to where it is pressed in by up to a millimetre, as a hand would,
  /// or apart by less than that. None if it is in the way of something out there, or meets nothing.
  std::optional<Pose> near_touch(Random& random) {
    constexpr double kFrom = 0.08;    // m
    constexpr double kStep = 0.0005;  // m
    auto [motion, out_W] = random_motion(ground_, random);
    const double least = random.uniform(-0.001, 0.001);
    for (double at = kFrom; at > -kStep; at -= kStep) {
      Pose there = motion;
      there.p += at * out_W;
      place(there);
      const auto found =
          finder_.find(ground_.tool, {.epsilon = kEpsilon, .of_tool = true, .remembers = false});
      if (found.empty()) continue;
      if (at == kFrom) return {};
      if (std::ranges::min(found, {}, &FoundContact::separation).separation > least) continue;
      if (is_deep(there)) return {};
      return there;
    }
    return {};
  }

  /// µs.
  double search(const Pose& motion) {
    place(motion);
    const auto begin = std::chrono::steady_clock::now();
    contacts_ += finder_.find(ground_.tool, {.epsilon = kEpsilon, .of_tool = true}).size();
    const auto end = std::chrono::steady_clock::now();
    return 1e6 * std::chrono::duration<double>(end - begin).count();
  }

  const Ground& ground_;
  ContactFinder finder_;
  std::size_t contacts_ = 0;
};

void ShippedScene(benchmark::State& state, const std::string& name) {
  const Scene scene = load_scene(HLM_WORLDS "/" + name + ".sdf");
  VirtualEnvironment environment(scene.world, scene.tools, FollowOptions{});
  const World& world = environment.world;
  const HeldTool& held = environment.tools[0];
  const std::size_t count = scene.world.bodies.size();
  Ground ground{.pieces = world.pieces(),
                .bodies = std::vector<ContactFinder::Body>(count),
                .tool = held.assembly.bodies,
                .X_WB = {},
                .planar = held.assembly.planar_normal_W.has_value(),
                .targets = count};
  for (std::size_t i = 0; i < count; ++i) {
    const int body = static_cast<int>(i);
    ground.bodies[i].movable = world.is_movable(body);
    ground.X_WB.push_back(world.pieces().is_fixed(body) ? Pose{} : world.X_WB(body));
  }
  for (std::size_t link = 0; link < ground.tool.size(); ++link) {
    ground.bodies[static_cast<std::size_t>(ground.tool[link])].link = static_cast<int>(link);
  }
  Timed timed(ground);
  for (auto _ : state) timed.run(state);
}

#define HLM_SCENE(name)                                     \
  BENCHMARK_CAPTURE(ShippedScene, name, std::string(#name)) \
      ->UseManualTime()                                     \
      ->Iterations(1)                                       \
      ->Unit(benchmark::kMicrosecond)
HLM_SCENE(assembly);
HLM_SCENE(bimanual);
HLM_SCENE(clutter);
HLM_SCENE(corner);
HLM_SCENE(door);
HLM_SCENE(lift);
HLM_SCENE(linkage);
HLM_SCENE(mesh);
HLM_SCENE(peg_in_hole_3d);
HLM_SCENE(playground);
HLM_SCENE(push);
HLM_SCENE(scale);
HLM_SCENE(scissors);
HLM_SCENE(stack);
HLM_SCENE(testbed);
#undef HLM_SCENE

/// Shapes and the sources of their pieces.
struct Parts {
  std::vector<std::unique_ptr<Convex>> shapes;
  std::vector<PieceSource> sources;

  void add(const CollisionId& id, const Shape& shape, const Pose& X_FG, bool fixed,
           const Mesh* mesh = nullptr, std::size_t triangle = 0) {
    shapes.push_back(std::make_unique<Convex>(shape));
    sources.push_back({.id = id,
                       .convex = shapes.back().get(),
                       .X_FG = X_FG,
                       .fixed = fixed,
                       .mesh = mesh,
                       .triangle = triangle});
  }
};

/// The tool is body 0, all others are touched.
void run_among(benchmark::State& state, const Parts& parts, std::vector<Pose> X_WB, bool movable) {
  const Pieces pieces(parts.sources);
  const std::size_t count = X_WB.size();
  Ground ground{.pieces = pieces,
                .bodies = std::vector<ContactFinder::Body>(count, {.movable = movable}),
                .tool = {0},
                .X_WB = std::move(X_WB),
                .targets = count};
  ground.bodies[0] = {.link = 0};
  Timed timed(ground);
  for (auto _ : state) timed.run(state);
}

/// 18,432 triangles on top and bottom of a closed mesh, and a box of 40 × 40 × 80 mm or a ball.
void Terrain(benchmark::State& state, const Shape& tool) {
  const Mesh mesh = terrain(68);
  Parts parts;
  parts.add({0, 0}, tool, {}, false);
  const std::vector<Hull> skin = skin_of(mesh);
  for (std::size_t i = 0; i < skin.size(); ++i) {
    parts.add({1, static_cast<int>(i)}, skin[i], {}, true, &mesh, i);
  }
  run_among(state, parts, {{}, {}}, false);
}

/// 10,000 boxes of 20 to 40 mm in a layer, of one body each, on a plane.
void Boxes(benchmark::State& state, bool movable) {
  Random random;
  Parts parts;
  std::vector<Pose> X_WB{{}};
  parts.add({0, 0}, Box{Vector3(0.04, 0.04, 0.08)}, {}, false);
  for (int i = 0; i < 10000; ++i) {
    const Vector3 size(random.uniform(0.02, 0.04), random.uniform(0.02, 0.04),
                       random.uniform(0.02, 0.04));
    const Pose X_WP{Vector3(0.045 * (i % 100 - 50), 0.045 * (i / 100 - 50), size.z() / 2),
                    Quaternion::Identity()};
    parts.add({i + 1, 0}, Box{size}, movable ? Pose{} : X_WP, !movable);
    X_WB.push_back(movable ? X_WP : Pose{});
  }
  parts.add({10001, 0}, HalfSpace{}, {}, true);
  X_WB.emplace_back();
  run_among(state, parts, X_WB, movable);
}

#define HLM_MADE(function, name, ...)            \
  BENCHMARK_CAPTURE(function, name, __VA_ARGS__) \
      ->UseManualTime()                          \
      ->Iterations(1)                            \
      ->Unit(benchmark::kMicrosecond)
HLM_MADE(Terrain, box, Shape(Box{Vector3(0.04, 0.04, 0.08)}));
HLM_MADE(Terrain, cylinder, Shape(Cylinder{0.02, 0.08}));
HLM_MADE(Terrain, ball, Shape(Sphere{0.02}));
HLM_MADE(Boxes, fixed, false);
HLM_MADE(Boxes, movable, true);
#undef HLM_MADE

}  // namespace
}  // namespace hlm::ve
