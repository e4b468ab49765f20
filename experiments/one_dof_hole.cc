// Figs. 6 and 9: a peg with one degree of freedom in a hole, shaken with 5 N at 10 Hz, coupled
// directly; the environment takes 20 ms for a step and is seen 20 ms late.
#include <algorithm>
#include <cmath>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

constexpr double kPeriod = 0.02;   // s, of the environment
constexpr double kLatency = 0.02;  // s
constexpr double kRadius = 0.02;   // m, of the peg: a ball touches each wall at one point

std::string wall(const std::string& name, double x) {
  const std::string plane = fmt::format(
      "<collision name='face'><geometry><plane><normal>{} 0 "
      "0</normal></plane></geometry></collision>",
      x < 0 ? 1 : -1);
  return test::fixed_model(name, fmt::format("{} 0 0 0 0 0", x), plane);
}

/// Walls are half-spaces: a peg thrown out of the hole is still inside one.
ve::WorldDescription world(double clearance) {
  const std::string ball = fmt::format(
      "<collision "
      "name='ball'><geometry><sphere><radius>{}</radius></sphere></geometry></collision>",
      kRadius);
  return test::world_of(
      wall("left", -kRadius - clearance) + wall("right", kRadius + clearance) +
      "<model name='peg'><link name='body'>" + test::kInertial + ball +
      "</link><joint name='rail' type='prismatic'><parent>world</parent><child>body</child>"
      "<axis><xyz>1 0 0</xyz></axis></joint></model>");
}

Task task(double amplitude, const ve::WorldDescription& world, double duration) {
  Task task;
  task.world = world;
  task.tool = "peg";
  task.device.damping = task.device.angular_damping = task.device.dry_friction = 0;
  task.device.max_force = task.device.max_force_rate = 1e12;
  task.hand = shake({amplitude, 0, 0}, 10);
  task.duration = duration;
  task.stiffness = 10'000;
  task.damping = 15;
  task.friction = 0;
  task.off_centre = 0;
  return task;
}

Conditions late(double servo_rate) {
  return {.servo_rate = servo_rate,
          .ve_low = 1 / kPeriod,
          .ve_high = 1 / kPeriod,
          .ve_delay = kLatency,
          .link = {}};
}

Conditions undelayed(double servo_rate) {
  return {.servo_rate = servo_rate, .ve_low = 1 / kPeriod, .ve_high = 1 / kPeriod, .link = {}};
}

double position(const server::TickRecord& tick) { return tick.X_WD.p.x(); }

double farthest(const Trace& trace, double until) {
  return largest(window(
      trace, [](const server::TickRecord& t) { return std::abs(position(t)); }, 0, until));
}

double portion_with_force(const Trace& trace) {
  const auto on = std::count_if(trace.ticks.begin(), trace.ticks.end(),
                                [](const auto& tick) { return std::abs(tick.F_env[0]) > 1e-9; });
  return static_cast<double>(on) / static_cast<double>(trace.ticks.size());
}

/// How deep the peg is in the wall at each update that brings one which was not there.
std::vector<double> arrival_depths(const Trace& trace, double clearance) {
  std::vector<double> depths;
  auto tick = trace.ticks.begin();
  for (const UpdateEffect& update : trace.updates) {
    while (tick->time < update.time) ++tick;
    if (update.arrived_n_W.x() == 0) continue;
    const double depth = -update.arrived_n_W.x() * position(*tick) - clearance;
    if (depth > 0) depths.push_back(depth);
  }
  return depths;
}

double portion_with_both_walls(const Trace& trace) {
  double updates = 0;
  double both = 0;
  for (const server::TickRecord& tick : trace.ticks) {
    if (tick.adopted == 0) continue;
    ++updates;
    both += tick.active_contacts + tick.predicted_contacts == 2;
  }
  return both / updates;
}

double largest_difference(const Trace& a, const Trace& b) {
  double difference = 0;
  for (std::size_t i = 0; i < std::min(a.ticks.size(), b.ticks.size()); ++i) {
    difference = std::max(difference, std::abs(position(a.ticks[i]) - position(b.ticks[i])));
  }
  return difference;
}

/// Time, s, position, m, force, N.
using Series = std::vector<std::array<double, 3>>;

/// As long as the session goes on: where a peg is thrown out it ends, and the poses mean nothing.
Series series_of(const Trace& trace) {
  Series series;
  for (const server::TickRecord& tick : trace.ticks) {
    const bool goes_on = renders_force(tick.server) && tick.session == trace.ticks.front().session;
    if (tick.time > 1.5 || !goes_on) break;
    series.push_back({tick.time, position(tick), tick.F_env[0]});
  }
  return series;
}

void write(Table& table, std::string_view label, const Series& series) {
  for (const auto& [time, x, force] : series) table.row(label, time, x, force);
}

struct Shaken {
  double farthest = 0;  ///< m.
  Series series;        ///< Of the first seed.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Shaken, farthest, series)

/// Of the hole with late walls, against the same without delay.
struct Compared {
  std::vector<double> depths;  ///< Of arrivals, m.
  double on = 0;               ///< Share of the time with force.
  double both = 0;             ///< Share of the updates with both walls.
  double farthest = 0;         ///< m.
  std::vector<double> jumps;   ///< At updates, N.
  double difference = 0;       ///< m.
  Series series;               ///< Of the first seed.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Compared, depths, on, both, farthest, jumps, difference, series)

}  // namespace

void one_dof_hole_unstable(Bench& bench) {
  const ve::WorldDescription hole = world(0);
  Table& series = bench.table("fig06_series", "method,time_s,x_m,force_N");
  for (const double rate : {512.0, 1000.0}) {
    for (const Method& method : bench.methods({"ir", "lm0-direct"})) {
      const bool is_ir = method.name == "ir";
      const auto inputs = [&](std::uint64_t seed) {
        return Inputs{{"method", method.name}, {"rate_hz", rate}, {"seed", seed}};
      };
      const std::vector<Shaken> all =
          bench.map(bench.seed_list(bench.seeds()), inputs, [&](std::uint64_t seed) {
            const Trace trace = run({task(5, hole, 2), method, late(rate), seed});
            return Shaken{farthest(trace, is_ir ? 1 : 2),
                          seed == bench.seed() ? series_of(trace) : Series{}};
          });
      std::vector<double> far;
      for (const Shaken& one : all) far.push_back(one.farthest);
      const auto [low, high] = std::minmax_element(far.begin(), far.end());
      if (is_ir) {
        bench.claim({.what = fmt::format("6(a), IR at {} Hz", rate),
                     .paper = "unstable: the peg is thrown out of the hole",
                     .criterion = "|x| > 500 mm within 1 s, all seeds",
                     .measured = fmt::format("{} m", spread(far)),
                     .holds = *low > 0.5});
      } else {
        bench.claim({.what = fmt::format("6(b), LM₀ at {} Hz", rate),
                     .paper = "stable",
                     .criterion = "bounded, largest |x| 2 to 25 mm, all seeds",
                     .measured = fmt::format("{} mm", spread(far, 1e3)),
                     .holds = *low > 2e-3 && *high < 25e-3});
      }
      if (rate == 1000) write(series, method.label, all.front().series);
    }
  }
}

void one_dof_hole_delay(Bench& bench) {
  constexpr double kRate = 1000;  // Hz
  constexpr double kDuration = 2;
  Table& series = bench.table("fig09_series", "method,time_s,x_m,force_N");
  for (const Method& method : bench.methods({"lm0-direct", "lm5-direct"})) {
    const auto shake_both = [&](double amplitude, double clearance) {
      const Task hole = task(amplitude, world(clearance), kDuration);
      const auto inputs = [&](std::uint64_t seed) {
        return Inputs{{"method", method.name}, {"clearance_m", clearance}, {"seed", seed}};
      };
      return bench.map(bench.seed_list(bench.seeds()), inputs, [&](std::uint64_t seed) {
        const Trace trace = run({hole, method, late(kRate), seed});
        Compared result{.depths = arrival_depths(trace, 0),
                        .on = portion_with_force(trace),
                        .both = portion_with_both_walls(trace),
                        .farthest = farthest(trace, kDuration),
                        .jumps = {},
                        .series = {}};
        for (const UpdateEffect& effect : trace.updates)
          result.jumps.push_back(std::max(effect.rise, effect.fall));
        result.difference = largest_difference(trace, run({hole, method, undelayed(kRate), seed}));
        if (seed == bench.seed()) result.series = series_of(trace);
        return result;
      });
    };
    const std::vector<Compared> all = shake_both(5, 0);
    write(series, method.label, all.front().series);
    std::vector<double> depth, on, both, far, jump, difference;
    for (const Compared& one : all) {
      depth.insert(depth.end(), one.depths.begin(), one.depths.end());
      on.push_back(one.on);
      both.push_back(one.both);
      far.push_back(one.farthest);
      jump.insert(jump.end(), one.jumps.begin(), one.jumps.end());
      difference.push_back(one.difference);
    }
    if (method.name == "lm0-direct") {
      bench.claim({.what = "9, LM₀",
                   .paper = "walls arrive several mm deep, the force comes and goes",
                   .criterion = "median penetration on arrival 1 to 10 mm",
                   .measured = fmt::format("{} mm", spread(depth, 1e3)),
                   .holds = !depth.empty() && median(depth) > 1e-3 && median(depth) < 10e-3});
      bench.claim({.what = "9, LM₀",
                   .criterion = "force on < 70 % of the time, all seeds",
                   .measured = fmt::format("{} %", spread(on, 100)),
                   .holds = largest(on) < 0.7});
      continue;
    }
    bench.claim({.what = "9, LM₅",
                 .paper = "the force is continuous",
                 .criterion = "force on > 95 % of the time, both walls present in 100 % of updates",
                 .measured = fmt::format("{} %; {} %", spread(on, 100), spread(both, 100)),
                 .holds = *std::min_element(on.begin(), on.end()) > 0.95 &&
                          *std::min_element(both.begin(), both.end()) == 1});
    bench.claim(
        {.what = "9, LM₅ against the hole without delay",
         .paper = "as if the virtual world were not delayed",
         .criterion = "x within 1e-9 m, max |x| < 1.5 mm, no jump at an update > 1e-9 N",
         .measured = fmt::format("{:.1e} m; {} mm; {:.1e} N", largest(difference), spread(far, 1e3),
                                 largest(jump)),
         .holds = largest(difference) < 1e-9 && largest(far) < 1.5e-3 && largest(jump) <= 1e-9});
    difference.clear();
    for (const Compared& one : shake_both(1, 0.0025)) difference.push_back(one.difference);
    bench.claim({.what = "9, LM₅ in a hole of 2.5 mm clearance, 1 N",
                 .paper = "not tried; shows the sign error in the printed Eq. 6",
                 .criterion = "x within 1e-9 m of the hole without delay",
                 .measured = fmt::format("{:.1e} m", largest(difference)),
                 .holds = largest(difference) < 1e-9});
  }
}

}  // namespace hlm::experiments
