// How long does the ε-query take: the peg in a hole of five walls, and single pairs?
#include <array>

#include <benchmark/benchmark.h>

#include "hlm/geometry/manifold.h"

namespace hlm::geometry {
namespace {

constexpr double kEpsilon = 0.005;  // m.

struct Wall {
  Convex convex;
  Pose X_WB;
};

Pose at(double x, double y, double z) { return {Vector3(x, y, z), Quaternion::Identity()}; }

/// The five walls of a hole of 40 × 40 × 80 mm, wider by `clearance`, m; its floor is at z = 0.
std::array<Wall, 5> hole(double clearance) {
  const double offset = (0.1 + clearance) / 2;
  const Convex side(Box{Vector3(0.06, 0.2, 0.14)});
  const Convex front(Box{Vector3(0.2, 0.06, 0.14)});
  const Convex floor(Box{Vector3(0.2, 0.2, 0.06)});
  return {Wall{side, at(-offset, 0, 0.01)}, Wall{side, at(offset, 0, 0.01)},
          Wall{front, at(0, -offset, 0.01)}, Wall{front, at(0, offset, 0.01)},
          Wall{floor, at(0, 0, -0.03)}};
}

/// Argument: clearance, µm. Tilt 0.01 rad. Goal: below 20 µs for all five walls.
void PegInHole(benchmark::State& state) {
  const Convex peg(Box{Vector3(0.04, 0.04, 0.08)});
  const Pose X_WT{Vector3(0, 0, 0.0405), rotation_from_vector(Vector3(0.006, 0.008, 0))};
  const auto walls = hole(static_cast<double>(state.range(0)) * 1e-6);
  ProximityStatistics statistics;
  std::size_t contacts = 0;
  for (auto _ : state) {
    contacts = 0;
    for (const Wall& wall : walls) {
      contacts += find_contacts(peg, X_WT, wall.convex, wall.X_WB, kEpsilon, statistics).size();
    }
    benchmark::DoNotOptimize(contacts);
  }
  state.counters["contacts"] = static_cast<double>(contacts);
}
BENCHMARK(PegInHole)->Arg(0)->Arg(500)->Arg(4000)->Unit(benchmark::kMicrosecond);

/// `tool` on a slab whose top is at z = 0, turned a little. Argument: separation, µm.
void on_slab(benchmark::State& state, const Shape& shape) {
  const Convex tool(shape);
  const Convex slab(Box{Vector3(0.4, 0.4, 0.1)});
  const Quaternion R = rotation_from_vector(Vector3(0.01, 0.02, 0.3));
  const double separation = static_cast<double>(state.range(0)) * 1e-6;
  const double lowest = tool.bounds({Vector3::Zero(), R}).min().z();
  const Pose X_WT{Vector3(0.01, 0.02, separation - lowest), R};
  ProximityStatistics statistics;
  std::size_t contacts = 0;
  for (auto _ : state) {
    contacts = find_contacts(tool, X_WT, slab, at(0, 0, -0.05), kEpsilon, statistics).size();
    benchmark::DoNotOptimize(contacts);
  }
  state.counters["contacts"] = static_cast<double>(contacts);
  state.counters["failures"] = static_cast<double>(statistics.failures);
}

void BoxOnBox(benchmark::State& state) { on_slab(state, Box{Vector3(0.04, 0.04, 0.08)}); }
void CylinderOnBox(benchmark::State& state) { on_slab(state, Cylinder{0.02, 0.08}); }
void CapsuleOnBox(benchmark::State& state) { on_slab(state, Capsule{0.02, 0.08}); }
void SphereOnBox(benchmark::State& state) { on_slab(state, Sphere{0.02}); }
BENCHMARK(BoxOnBox)->Arg(2000)->Arg(-1000)->Unit(benchmark::kMicrosecond);
BENCHMARK(CylinderOnBox)->Arg(2000)->Arg(-1000)->Unit(benchmark::kMicrosecond);
BENCHMARK(CapsuleOnBox)->Arg(2000)->Arg(-1000)->Unit(benchmark::kMicrosecond);
BENCHMARK(SphereOnBox)->Arg(2000)->Arg(-1000)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace hlm::geometry
