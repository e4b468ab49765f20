// What do the query and the engine's step of a frame cost in worlds of many bodies?
#include <cmath>
#include <map>
#include <string>

#include <benchmark/benchmark.h>

#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/scene/scene.h"

namespace hlm::ve {
namespace {

constexpr double kPeriod = 1.0 / 60;  // s
constexpr double kSmallest = 0.005;   // ε, m

/// A shipped scene after 3 s, when what can fall has fallen; one for all runs.
VirtualEnvironment& settled(const std::string& name) {
  static std::map<std::string, VirtualEnvironment> environments;
  const auto known = environments.find(name);
  if (known != environments.end()) return known->second;
  const Scene scene = load_scene(HLM_WORLDS "/" + name + ".sdf");
  VirtualEnvironment& environment =
      environments.try_emplace(name, scene.world, scene.tools, FollowOptions{}).first->second;
  for (int i = 0; i < 180; ++i) environment.world.step(kPeriod, {});
  return environment;
}

/// The contacts of the tool that are sent, with ε of so many millimetres, and those of the bodies
/// that it can push, while the tool is led in circles of 0.1 m among the things of the scene, 0.3
/// m/s.
void ScaleQuery(benchmark::State& state) {
  const double epsilon = 1e-3 * static_cast<double>(state.range(0));
  constexpr double kSpeed = 0.3;  // m/s
  VirtualEnvironment& environment = settled("scale");
  HeldTool& held = environment.tools[0];
  const int rod = held.assembly.bodies[0];
  double angle = 0;
  double contacts = 0;
  double bodies = 0;
  for (auto _ : state) {
    state.PauseTiming();
    angle += 3 * kPeriod;
    const Vector3 p(0.1 * std::cos(angle), 0.1 * std::sin(angle), 0.034);
    environment.world.set_pose(rod, {p, Quaternion::Identity()});
    held.tool.read_back();
    Velocity v = Velocity::Zero(6);
    v.head<2>() = kSpeed * Eigen::Vector2d(-std::sin(angle), std::cos(angle));
    held.tool.set_target(held.tool.q(), v);
    state.ResumeTiming();
    const auto found = held.proximity.query(held.tool, epsilon);
    const auto selected = held.selection.select(found, {});
    std::vector<FoundContact> of_tool(selected.begin(), selected.end());
    held.surroundings.find(of_tool, kSmallest);
    contacts += static_cast<double>(of_tool.size() + held.surroundings.contacts().size());
    bodies += static_cast<double>(held.surroundings.bodies().size());
  }
  using Counter = benchmark::Counter;
  state.counters["contacts"] = Counter(contacts, Counter::kAvgIterations);
  state.counters["bodies"] = Counter(bodies, Counter::kAvgIterations);
}
BENCHMARK(ScaleQuery)->Arg(5)->Arg(20)->Arg(50)->Arg(100)->Arg(200)->Unit(benchmark::kMicrosecond);

void step_at_rest(benchmark::State& state, const char* name) {
  World& world = settled(name).world;
  for (auto _ : state) world.step(kPeriod, {});
}

/// Every body gets a push of 5 % of its weight to and fro, so that none rests.
void step_stirred(benchmark::State& state, const char* name) {
  World& world = settled(name).world;
  const auto& bodies = world.description().bodies;
  double time = 0;
  for (auto _ : state) {
    time += kPeriod;
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
      if (!world.is_movable(i)) continue;
      Wrench F = Wrench::Zero();
      F.x() = 0.5 * bodies[static_cast<std::size_t>(i)].mass * std::sin(6 * time + i);
      world.add_wrench(i, F);
    }
    world.step(kPeriod, {});
  }
}

void ScaleStepAtRest(benchmark::State& state) { step_at_rest(state, "scale"); }
void ScaleStepStirred(benchmark::State& state) { step_stirred(state, "scale"); }
BENCHMARK(ScaleStepAtRest)->Unit(benchmark::kMillisecond);
BENCHMARK(ScaleStepStirred)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hlm::ve
