// Six degrees of freedom, where the paper shows a plane: a square peg in a square hole, and a box
// that is set down on an edge and pressed flat.
#include <map>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/experiments.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

/// Floor at z = 0; the hole is 40 mm square, 80 mm deep, around the z axis.
ve::WorldDescription hole_world() {
  const auto block = [](const char* name, const char* pose) {
    return fmt::format(
        "<collision name='{}'><pose>{} 0 0 0</pose><geometry><box><size>0.2 0.2 0.1</size></box>"
        "</geometry></collision>",
        name, pose);
  };
  const std::string walls = block("east", "0.12 0 0.03") + block("west", "-0.12 0 0.03") +
                            block("north", "0 0.12 0.03") + block("south", "0 -0.12 0.03") +
                            block("floor", "0 0 -0.05");
  return test::world_of(test::fixed_model("hole", "0 0 0 0 0 0", walls) +
                        test::model("peg", "0 0 0.04 0 0 0", test::box("0.04 0.04 0.08")));
}

ve::WorldDescription table_world(double tilt) {
  const std::string top =
      "<collision name='top'><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>1 1 0.2</size></box>"
      "</geometry></collision>";
  return test::world_of(
      test::fixed_model("table", "0 0 0 0 0 0", top) +
      test::model("peg", fmt::format("0 0 0.04 0 {} 0", tilt), test::box("0.08 0.06 0.04")));
}

Task spatial_task(ve::WorldDescription world, const server::HandSegment& hand, double duration) {
  Task task;
  task.world = std::move(world);
  task.tool = "peg";
  task.device.freedom = server::DeviceFreedom::kSpatial;
  task.hand = hand;
  task.duration = duration;
  return task;
}

std::vector<Job> jobs_of(const Bench& bench) {
  return bench.jobs({"ir", "lm0", "lm5", "lm-adaptive"}, bench.quick() ? 2 : bench.seeds());
}

/// Of all seeds of one method.
struct Outcomes {
  std::vector<double> distance;  ///< m.
  std::vector<double> rotation;  ///< rad.
  std::vector<double> energy;    ///< J.
};

void square_hole(Bench& bench) {
  server::HandSegment hand = shake({1, 0.7, 0}, 2.5);
  std::get<server::Push>(hand.action).constant[2] = -0.5;  // N: it is held down
  const Task task = spatial_task(hole_world(), hand, 5);
  const std::vector<Job> jobs = jobs_of(bench);
  const std::vector<Trace> traces = bench.map(jobs, [&](const Job& job) {
    return run({task, job.method, {}, job.seed});
  });
  Pose X_W0;
  X_W0.p.z() = 0.04;
  std::map<std::string_view, Outcomes> of;
  Table& trials = bench.table("spatial_hole", "method,seed,distance_m,rotation_rad,energy_J");
  Table& series = bench.table("spatial_hole_series", "method,time_s,x_m,y_m,z_m,rotation_rad");
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const auto& [method, seed] = jobs[i];
    Outcomes& o = of[method.name];
    const Excursion far = excursion(traces[i], X_W0);
    o.distance.push_back(far.distance);
    o.rotation.push_back(far.rotation);
    o.energy.push_back(generated_energy(traces[i]));
    trials.row(method.label, static_cast<double>(seed), far.distance, far.rotation,
               o.energy.back());
    if (seed != bench.seed()) continue;
    for (std::size_t k = 0; k < traces[i].ticks.size(); k += 4) {
      const Pose& X = traces[i].ticks[k].X_WD;
      series.row(method.label, traces[i].ticks[k].time, X.p.x(), X.p.y(), X.p.z(),
                 displacement(X_W0, X).tail<3>().norm());
    }
  }
  for (const char* name : {"lm0", "lm5", "lm-adaptive"}) {
    const Outcomes& o = of[name];
    if (o.energy.empty()) continue;
    const bool predicts = std::string(name) != "lm0";
    const bool stable = largest(o.energy) <= kUnstableEnergy;
    bench.claim({.what = fmt::format("Square peg in a square hole, {}", method(name).label),
                 .criterion = predicts ? "stable; moves < 1 mm and < 1°, all seeds" : "stable",
                 .measured = fmt::format("{} mm, {}°, {} mJ", spread(o.distance, 1e3),
                                         spread(o.rotation, kDegree), spread(o.energy, 1e3)),
                 .holds = stable && (!predicts || (largest(o.distance) < 1e-3 &&
                                                   largest(o.rotation) * kDegree < 1))});
  }
  if (const Outcomes& o = of["ir"]; !o.energy.empty()) {
    bench.find(fmt::format("IR, square peg in a square hole: moves {} mm, {}°; {} mJ generated.",
                           spread(o.distance, 1e3), spread(o.rotation, kDegree),
                           spread(o.energy, 1e3)));
  }
}

void box_on_edge(Bench& bench) {
  const Task task = spatial_task(table_world(0.4), push({0, 0, -0.5}), 6);
  const std::vector<Job> jobs = jobs_of(bench);
  const std::vector<Trace> traces = bench.map(jobs, [&](const Job& job) {
    return run({task, job.method, {}, job.seed});
  });
  const auto tilt = [](const server::TickRecord& t) {
    return std::acos(std::min(1.0, (t.X_WD.R * Vector3::UnitZ()).z()));
  };
  struct Rest {
    std::vector<double> tilt;  ///< In the last second, rad.
    std::vector<double> sway;  ///< Peak to peak of the height in the last second, m.
  };
  std::map<std::string_view, Rest> of;
  Table& trials = bench.table("spatial_box", "method,seed,tilt_rad,sway_m");
  Table& series = bench.table("spatial_box_series", "method,time_s,z_m,tilt_rad");
  const auto height = [](const server::TickRecord& t) { return t.X_WD.p.z(); };
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const auto& [method, seed] = jobs[i];
    Rest& rest = of[method.name];
    rest.tilt.push_back(largest(window(traces[i], tilt, 5, 6)));
    rest.sway.push_back(peak_to_peak(window(traces[i], height, 5, 6)));
    trials.row(method.label, static_cast<double>(seed), rest.tilt.back(), rest.sway.back());
    if (seed != bench.seed()) continue;
    for (std::size_t k = 0; k < traces[i].ticks.size(); k += 4) {
      series.row(method.label, traces[i].ticks[k].time, height(traces[i].ticks[k]),
                 tilt(traces[i].ticks[k]));
    }
  }
  const auto words = [](const Rest& rest) {
    return fmt::format("{}° off flat, {} mm peak to peak", spread(rest.tilt, kDegree),
                       spread(rest.sway, 1e3));
  };
  // Without prediction the late contacts keep the tilt at which they arrived.
  const std::map<std::string_view, double> largest_tilt{
      {"lm0", 15}, {"lm5", 3}, {"lm-adaptive", 0.1}};
  for (const auto& [name, degrees] : largest_tilt) {
    const Rest& rest = of[name];
    if (rest.tilt.empty()) continue;
    bench.claim(
        {.what = fmt::format("Box set down on an edge, {}", method(name).label),
         .criterion = fmt::format("comes to rest (last 1 s < 0.01 mm peak to peak) within {}° of "
                                  "flat, all seeds",
                                  degrees),
         .measured = words(rest),
         .holds = largest(rest.sway) < 1e-5 && largest(rest.tilt) * kDegree < degrees});
  }
  if (const Rest& rest = of["ir"]; !rest.tilt.empty()) {
    bench.find(fmt::format("IR, box set down on an edge, in the last second: {}.", words(rest)));
  }
}

}  // namespace

void spatial(Bench& bench) {
  square_hole(bench);
  box_on_edge(bench);
}

}  // namespace hlm::experiments
