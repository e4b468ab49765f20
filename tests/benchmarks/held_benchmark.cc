// What a tick costs while the hand carries a tower, shapes and all (docs/method.md 21).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/placed_shape.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr double kEdge = 0.04;  // m
constexpr double kTray = 0.01;  // m, height of the tray

/// Cubes of 0.3 kg on each other, sixteen in two columns, on a tray that a spring holds and moves
/// to and fro.
void Tower(benchmark::State& state) {
  ToolDescription tool;
  tool.links.emplace_back().mass = 0.5;
  tool.links[0].I_LCom = Matrix3::Identity() * 1e-3;
  tool.links[0].joint = JointType::kFree;
  std::vector<PlacedShape> shapes{test::rough_box({0.1, 0.1, kTray}, {SideKind::kToolLink, 0})};
  std::vector<BodyInertia> inertias;
  BodyPoses poses;
  const std::uint32_t columns = state.range(0) > 8 ? 4 : 1;
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(state.range(0)); ++i) {
    shapes.push_back(test::rough_box(Vector3::Constant(kEdge), {SideKind::kMovableBody, i}));
    inertias.push_back({.body = i,
                        .mass = 0.3,
                        .I_BCom = 0.3 * kEdge * kEdge / 6 * Matrix3::Identity(),
                        .gravity_W = {0, 0, -9.81}});
    const double x = columns == 1 ? 0 : i % 2 == 0 ? -1 : 1;
    const double y = columns == 1 ? 0 : i / 2 % 2 == 0 ? -1 : 1;
    const Vector3 p(0.6 * kEdge * x, 0.6 * kEdge * y, kTray / 2 + kEdge * (0.5 + i / columns));
    poses.push_back({.body = i, .X_WB = {p, Quaternion::Identity()}});
  }
  Scene scene(std::move(shapes), std::span<const std::pair<std::uint32_t, std::uint32_t>>(), tool,
              inertias);
  LocalModel model(tool, ToolModel(tool).neutral(), LocalModelParameters(), kStep);
  model.set_scene(&scene);
  model.adopt({.contacts = ReportedContacts(), .q_VE = ToolModel(tool).neutral(), .poses = poses});
  double time = 0;
  const auto step = [&] {
    time += kStep;
    HandInput hand;
    hand.stiffness << Vector3::Constant(5000), Vector3::Constant(50);
    hand.damping << Vector3::Constant(200), Vector3::Constant(1);
    hand.F = -hand.damping.cwiseProduct(model.hand_twist());
    const double load = 0.3 * 9.81 * static_cast<double>(state.range(0));
    const Vector3 target(0.005 * std::sin(3 * time), 0, 0);
    hand.F.head<3>() += 5000 * (target - model.proxy().X_WH().p) + Vector3(0, 0, load);
    hand.F.tail<3>() -= 50 * 2 * model.proxy().X_WH().R.vec();
    return model.step(hand);
  };
  for (int i = 0; i < 2000; ++i) step();
  for (auto _ : state) benchmark::DoNotOptimize(step());
  state.counters["held"] = static_cast<double>(model.held().size());
  state.counters["contacts"] =
      static_cast<double>(model.contacts().size() + model.supports().size());
}
BENCHMARK(Tower)->ArgName("bodies")->Arg(1)->Arg(2)->Arg(4)->Arg(8)->Arg(16)->Unit(
    benchmark::kMicrosecond);

}  // namespace
}  // namespace hlm::server
