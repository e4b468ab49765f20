// What do solids of 200,000 triangles cost: to load, to ask for a distance, and to search for the
// contacts of a tool that is pressed onto them?
//
// Each line: the median, and the searches at 99 % and 99.9 %, µs; each search is the shortest of a
// few, for others use the machine, too.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "hlm/geometry/shape_parts.h"
#include "hlm/geometry/solid_contacts.h"
#include "tests/support/random.h"
#include "tests/support/solid_meshes.h"

namespace hlm::test {
unsigned random_seed() { return 1; }
}  // namespace hlm::test

namespace hlm::geometry {
namespace {

using test::Random;
using Clock = std::chrono::steady_clock;

constexpr double kEpsilon = 0.0015;  // m, of a tick at 0.1 m/s.
constexpr double kTick = 0.0001;     // m
constexpr int kPoses = 200;
constexpr int kTicks = 8;
constexpr int kRuns = 5;
constexpr double kRadius = 0.1;  // m, of the ball.

double microseconds(Clock::time_point begin) {
  return 1e6 * std::chrono::duration<double>(Clock::now() - begin).count();
}

void report(benchmark::State& state, std::vector<double> times) {
  std::ranges::sort(times);
  const auto at = [&](double share) {
    return times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
  };
  state.counters["_50"] = at(0.5);
  state.counters["_99"] = at(0.99);
  state.counters["_99.9"] = at(0.999);
  state.SetIterationTime(1e-6 * at(0.5));
}

Mesh ball_mesh() {
  Random random;
  return test::bumpy_ball(317, kRadius, 0, random);
}
Mesh sheet_mesh() { return test::wavy_sheet(317, 0.6 / 317, 0.01); }

void Load(benchmark::State& state) {
  const Mesh mesh = ball_mesh();
  for (auto _ : state) {
    const ShapeParts parts = parts_of(mesh, "it", MeshUse::kSolids);
    benchmark::DoNotOptimize(parts.solids.data());
  }
  state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
}
BENCHMARK(Load)->Unit(benchmark::kMillisecond);

void Distance(benchmark::State& state) {
  const ShapeParts parts = parts_of(ball_mesh(), "it", MeshUse::kSolids);
  Random random;
  std::vector<double> times;
  double sum = 0;
  for (auto _ : state) {
    for (int i = 0; i < 5000; ++i) {
      const Vector3 p = (kRadius + random.uniform(-0.005, 0.005)) * random.direction();
      double least = 1e9;
      for (int run = 0; run < kRuns; ++run) {
        const auto begin = Clock::now();
        sum += parts.solids.front().distance(p);
        least = std::min(least, microseconds(begin));
      }
      times.push_back(least);
    }
    report(state, times);
  }
  benchmark::DoNotOptimize(sum);
}
BENCHMARK(Distance)->UseManualTime()->Iterations(1)->Unit(benchmark::kMicrosecond);

/// The tool comes down along `out` until it overlaps by 0.1 mm to 0.5 mm, then moves to and fro.
void Tool(benchmark::State& state, const Shape& shape, bool on_sheet) {
  const ShapeParts parts = parts_of(on_sheet ? sheet_mesh() : ball_mesh(), "it", MeshUse::kSolids);
  const MeshSolid& solid = parts.solids.front();
  const Convex tool(shape);
  Random random;
  std::vector<double> times;
  double contacts = 0;
  for (auto _ : state) {
    for (int pose = 0; pose < kPoses; ++pose) {
      Pose X_ST{Vector3::Zero(), rotation_from_vector(random.vector(0.3))};
      const Vector3 out = on_sheet ? Vector3(Vector3::UnitZ()) : random.direction();
      const Vector3 from = on_sheet
                               ? Vector3(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 0)
                               : Vector3(Vector3::Zero());
      SolidMemory before;
      SolidMemory now;
      for (double height = 0.2; height > -0.1; height -= 4e-4) {
        X_ST.p = from + height * out;
        find_solid_contacts(tool, X_ST, solid, kEpsilon, nullptr, now);
        if (now.depth > 1e-4) break;
      }
      before = now;
      const Vector3 way = kTick * random.direction();
      for (int tick = 0; tick < kTicks; ++tick) {
        X_ST.p += (tick % 4 < 2 ? 1 : -1) * way;
        double least = 1e9;
        for (int run = 0; run < kRuns; ++run) {
          const auto begin = Clock::now();
          contacts += static_cast<double>(
              find_solid_contacts(tool, X_ST, solid, kEpsilon, &before, now).size());
          least = std::min(least, microseconds(begin));
        }
        times.push_back(least);
        before = now;
      }
    }
    report(state, times);
  }
  state.counters["contacts"] = contacts / (kPoses * kTicks * kRuns);
}

#define HLM_TOOL(name, ...)                  \
  BENCHMARK_CAPTURE(Tool, name, __VA_ARGS__) \
      ->UseManualTime()                      \
      ->Iterations(1)                        \
      ->Unit(benchmark::kMicrosecond)
HLM_TOOL(ball_on_ball, Shape(Sphere{0.01}), false);
HLM_TOOL(box_on_ball, Shape(Box{Vector3(0.04, 0.04, 0.08)}), false);
HLM_TOOL(small_box_on_ball, Shape(Box{Vector3(0.01, 0.01, 0.01)}), false);
HLM_TOOL(cylinder_on_ball, Shape(Cylinder{0.02, 0.08}), false);
HLM_TOOL(ball_on_sheet, Shape(Sphere{0.01}), true);
HLM_TOOL(box_on_sheet, Shape(Box{Vector3(0.04, 0.04, 0.08)}), true);
HLM_TOOL(small_box_on_sheet, Shape(Box{Vector3(0.01, 0.01, 0.01)}), true);
HLM_TOOL(capsule_on_sheet, Shape(Capsule{0.01, 0.05}), true);

}  // namespace
}  // namespace hlm::geometry
