// Where the forces of bodies that move when pushed are right, over delay, mass, stiffness and rate.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/body_tasks.h"
#include "experiments/experiments.h"
#include "hlm/common/uniform.h"

namespace hlm::experiments {
namespace {

const std::vector<double> kDelays{0, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1};  // s each way
const std::vector<double> kMasses{0.1, 0.3, 1, 3, 5};                       // kg

struct Kind {
  std::string name;
  BodyTask (*task)(double mass);
  Vector3 axis;                ///< Of the force on the hand.
  double (*due)(double mass);  ///< N.
  double other;                ///< N: of the tool's own weight, in the same direction.
  double begin;                ///< s.
  double end;
};

const std::vector<Kind> kKinds{
    {"lift", lift, -Vector3::UnitZ(), [](double mass) { return mass * kGravity; }, 0.5 * kGravity,
     3, 4.5},
    {"slide", [](double mass) { return slide({.mass = mass}); }, -Vector3::UnitX(),
     [](double mass) { return 0.4 * mass * kGravity; }, 0, 1.5, 3.5},
    {"jam", [](double mass) { return jam({.mass = mass}); }, -Vector3::UnitX(),
     [](double) { return 3.0; }, 0, 3, 4.5},
    {"rest", rest, Vector3::UnitZ(), [](double) { return 2.0; }, 0, 3, 4.5},
    {"tower", rest_on_tower, Vector3::UnitZ(), [](double) { return 2.0; }, 0, 3, 4.5},
};

struct BodyPlace {
  const Kind* kind;
  double mass;
  BodyConditions conditions;
};

/// A force within 10 % of what is due, of which the standard deviation is no more than 6 % (at
/// least 0.05 N), is felt as the body.
bool is_right(const ForceStatistics& f, double due) {
  return std::abs(f.mean / due - 1) <= 0.1 && f.deviation <= std::max(0.05, 0.06 * due);
}

std::vector<BodyPlace> places() {
  std::vector<BodyPlace> all;
  for (const Kind& kind : kKinds) {
    for (const double rate : {60.0, 30.0}) {
      for (const double k : {4000.0, 16000.0, 50000.0}) {
        for (const double mass : kMasses) {
          for (const double delay : kDelays) {
            all.push_back({&kind, mass, {.ve_rate = rate, .delay = delay, .stiffness = k}});
          }
        }
      }
    }
  }
  return all;
}

/// waits: the hand begins so much later, s.
ForceStatistics felt_force(const BodyPlace& place, std::uint64_t seed, double waits) {
  const BodyTask task = later(place.kind->task(place.mass), waits);
  ForceStatistics f = force_along(run(task, place.conditions, seed), place.kind->axis,
                                  place.kind->begin + waits, place.kind->end + waits);
  f.mean -= place.kind->other;
  return f;
}

/// The map, and of the delays up to 20 ms what the claims ask.
void draw_map(Bench& bench) {
  const std::vector<BodyPlace> all = places();
  const auto inputs = [](const BodyPlace& place) {
    return Inputs{{"task", place.kind->name}, {"mass_kg", place.mass}} +
           inputs_of(place.conditions);
  };
  const auto forces = bench.map(
      all, inputs, [&](const BodyPlace& place) { return felt_force(place, bench.seed(), 0); });
  Table& table = bench.table("bodylimits",
                             "task,ve_rate_Hz,stiffness,mass_kg,delay_s,due_N,mean_N,sd_N,"
                             "update_step_N,collisions,right");
  for (const Kind& kind : kKinds) {
    int near = 0;
    int near_right = 0;
    int far = 0;
    int far_right = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].kind != &kind) continue;
      const BodyConditions& c = all[i].conditions;
      const double due = kind.due(all[i].mass);
      const bool right = is_right(forces[i], due);
      table.row(kind.name, c.ve_rate, c.stiffness, all[i].mass, c.delay, due, forces[i].mean,
                forces[i].deviation, forces[i].update_step,
                static_cast<double>(forces[i].collisions), right ? 1.0 : 0.0);
      const bool is_near = c.delay <= 0.02 && all[i].mass >= 0.3 && all[i].mass <= 3;
      ++(is_near ? near : far);
      (is_near ? near_right : far_right) += right;
    }
    bench.claim({.what = fmt::format("Bodies to their limits, {}", kind.name),
                 .criterion =
                     "to 20 ms each way, 0.3 to 3 kg, 4 to 50 kN/m, 30 and 60 Hz: the mean "
                     "within 10 % of what is due, sd at most 6 % of it or 0.05 N",
                 .measured = fmt::format("{} of {}; beyond, 0.1 to 5 kg and to 100 ms, {} of {}",
                                         near_right, near, far_right, far),
                 .holds = near_right == near});
  }
}

/// What the user may give values to.
struct WantedBody {
  double mass = 0.3;  ///< kg.
  BodyConditions conditions;
};

void declare_wanted_body(settings::Table& table, WantedBody& wanted) {
  BodyConditions& conditions = wanted.conditions;
  table.number("mass", wanted.mass, {0.01, 100, "kg"}, "Of the body");
  table.number("delay", conditions.delay, {0, 10, "s"}, "Of the network, one way");
  table.number("rate", conditions.ve_rate, {1, 1000, "Hz"}, "Of the environment");
  table.number("loss", conditions.loss, {0, 0.9, ""}, "Share of datagrams");
  table.number("stiffness", conditions.stiffness, {1, 1e7, "N/m"}, "Of contacts");
  table.file("device", conditions.device, "Keys of a simulated device, TOML");
}

/// A moment of a frame, drawn from the seed, s.
double phase(const BodyPlace& place, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  return uniform(engine, 0, 1 / place.conditions.ve_rate);
}

/// The bodies with the user's values.
void bodies_over(Bench& bench) {
  std::vector<SweptCell> cells;
  const auto variants = bench.over().variants(WantedBody{}, declare_wanted_body);
  for (const Kind& kind : kKinds) {
    for (const Method& method : bench.methods_or({"lm5", "shapes"})) {
      for (const auto& [wanted, given] : variants) {
        BodyPlace place{&kind, wanted.mass, wanted.conditions};
        place.conditions.method = method;
        for (const std::uint64_t seed : bench.seeds_of_variant()) {
          cells.push_back({method.name, Inputs{{"task", kind.name}} + given, seed, [place, seed] {
                             const ForceStatistics f = felt_force(place, seed, phase(place, seed));
                             const double due = place.kind->due(place.mass);
                             return std::vector<Swept>{
                                 {.what = place.kind->name,
                                  .unit = "N",
                                  .criterion = "mean within 10 %, sd at most 6 %",
                                  .value = f.mean,
                                  .due = due,
                                  .deviation = f.deviation,
                                  .right = is_right(f, due)}};
                           }});
        }
      }
    }
  }
  sweep_over(bench, "bodylimits", cells);
}

}  // namespace

void body_limits(Bench& bench) {
  if (bench.over().any()) return bodies_over(bench);
  draw_map(bench);
}

}  // namespace hlm::experiments
