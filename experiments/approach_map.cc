// Where a wall is felt, over the speed at which it is approached, 20 ms away and at 30 to 60 Hz.
#include <algorithm>
#include <cmath>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

constexpr double kRest = 3;  // s: from the end of the run-up to the end

/// A peg that lies before a wall: it touches at y = 0.
ve::WorldDescription world() {
  const std::string wall =
      "<collision name='face'><geometry><plane><normal>0 -1 0</normal></plane></geometry>"
      "</collision>";
  return test::world_of(test::fixed_model("wall", "0 0.02 0 0 0 0", wall) +
                        test::model("peg", "0 0 0 0 0 0", test::box("0.08 0.04 0.04"),
                                    "<haptic:tool_joint>planar</haptic:tool_joint>"));
}

/// Where the hand's wrench reaches the proxy too, as much again draws the handle along.
double share_of_hand(const Method& method) {
  return method.controller == ControllerKind::kFourChannel ? 2 : 1;
}

/// A constant push under which the device's damping lets it reach `speed`, with a run-up of three
/// time constants.
Task task(const ve::WorldDescription& world, const Method& method, double speed) {
  Task task;
  const server::SimulatedDeviceOptions& device = task.device;
  const double run_up = 1.2;  // s
  Pose X_WB;
  X_WB.p.y() = -speed * run_up - 0.01;
  task.world = ve::with_model_at(world, "peg", X_WB);
  task.tool = "peg";
  task.hand = push({0, (device.damping * speed + device.dry_friction) / share_of_hand(method), 0});
  task.duration = 2 * run_up + kRest;
  task.off_centre = 0;
  return task;
}

struct Rested {
  double arrival = 0;    ///< Speed 5 mm before the wall, m/s.
  double error = 0;      ///< Where the handle rests, from where it should, m.
  double overshoot = 0;  ///< Farthest beyond the wall, m.
  double drift = 0;      ///< Largest distance of the handle from the environment's tool, m.
  double sway = 0;       ///< Peak to peak of the last second, m.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Rested, arrival, error, overshoot, drift, sway)

/// A method with which the handle does not arrive, and the lowest speed at which it does not.
struct Stuck {
  std::string method;
  double speed;  ///< m/s.
};

Rested rested(const Trace& trace) {
  Rested result;
  const double end = trace.ticks.back().time;
  const auto y = [](const server::TickRecord& t) { return t.X_WD.p.y(); };
  result.error = std::abs(mean(window(trace, y, end - 1, end)));
  result.overshoot = largest(window(trace, y, 0, end));
  result.drift = largest(window(
      trace, [](const server::TickRecord& t) { return (t.X_WD.p - t.X_WT.p).norm(); }, 0, end));
  for (const server::TickRecord& tick : trace.ticks) {
    if (tick.X_WD.p.y() < -0.005) continue;
    result.arrival = tick.V_WD[1];
    break;
  }
  result.sway = peak_to_peak(window(trace, y, end - 1, end));
  return result;
}

}  // namespace

void approach_map(Bench& bench) {
  const ve::WorldDescription wall = world();
  std::vector<std::string> names{"ir", "lm5", "shapes"};
  std::vector<double> speeds{0.1, 0.3, 0.5, 1};
  if (!bench.quick()) {
    names = {"ir", "ir-rot", "vrpn", "coupler", "engine", "lm0", "lm5", "shapes"};
    speeds = {0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1};
  }
  const std::vector<Method> compared = bench.methods(names);
  const int seeds = bench.quick() ? 2 : bench.seeds();
  struct Approach {
    Method method;
    double speed;
    std::uint64_t seed;
  };
  std::vector<Approach> jobs;
  for (const Method& method : compared) {
    for (const double speed : speeds) {
      for (const std::uint64_t seed : bench.seed_list(seeds)) jobs.push_back({method, speed, seed});
    }
  }
  Conditions conditions;
  conditions.link.delay = 0.02;
  const auto inputs_of = [](const Approach& job) {
    return Inputs{{"method", job.method.name}, {"speed_m_s", job.speed}, {"seed", job.seed}};
  };
  const std::vector<Rested> outcomes = bench.map(jobs, inputs_of, [&](const Approach& job) {
    return rested(run({task(wall, job.method, job.speed), job.method, conditions, job.seed}));
  });

  Table& table = bench.table(
      "approach", "method,speed_m_s,seed,arrival_m_s,error_m,overshoot_m,drift_m,sway_m");
  std::map<double, std::vector<double>> of_shapes;
  double sway_of_shapes = 0;
  double slowest = 1;  // arrival, as a portion of the wanted speed
  std::vector<Stuck> stuck;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const auto& [method, speed, seed] = jobs[i];
    const Rested& o = outcomes[i];
    table.row(method.label, speed, static_cast<double>(seed), o.arrival, o.error, o.overshoot,
              o.drift, o.sway);
    if (o.arrival == 0 && seed == bench.seed()) {
      const bool known = !stuck.empty() && stuck.back().method == method.label;
      if (!known) stuck.push_back({std::string(method.label), speed});
    }
    if (method.name != "shapes") continue;
    sway_of_shapes = std::max(sway_of_shapes, o.sway);
    slowest = std::min(slowest, o.arrival / speed);
    if (speed <= 0.5) of_shapes[speed].push_back(o.error);
  }
  for (const auto& [method, speed] : stuck) {
    bench.find(
        fmt::format("{}: from {} m/s on the handle does not reach the wall, held back in free "
                    "motion by a spring to a tool that is seen late.",
                    method, speed));
  }
  if (of_shapes.empty()) return;
  double worst = 0;
  for (const auto& [speed, errors] : of_shapes) worst = std::max(worst, mean(errors));
  bench.claim(
      {.what = "LM shapes",
       .criterion = "mean error of the perceived wall < 1 mm up to 0.5 m/s, at 30 to 60 Hz "
                    "and 20 ms one way; at rest there (< 0.01 mm peak to peak) up to 1 m/s",
       .measured = fmt::format("{:.3f} mm at worst; {:.1e} mm peak to peak at worst; arrived "
                               "with {:.0f} % of the speed or more",
                               1e3 * worst, 1e3 * sway_of_shapes, 100 * slowest),
       .holds = worst < 1e-3 && sway_of_shapes < 1e-5 && slowest > 0.9});
}

}  // namespace hlm::experiments
