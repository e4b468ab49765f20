// Figs. 16 and 17: the peg in its hole, shaken with 1 N at the stiffness that the paper's baseline
// bears, and with 3 N at almost four times that.
#include <algorithm>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "experiments/hole_task.h"

namespace hlm::experiments {
namespace {

/// Of all seeds of one method.
struct HeldPegs {
  std::vector<double> x;       ///< Largest distance from the hole's axis, m.
  std::vector<double> y;       ///< Peak to peak, m.
  std::vector<double> theta;   ///< Largest rotation, rad.
  std::vector<double> energy;  ///< Generated, J.
  int unstable = 0;
  int trials = 0;
};

/// Of one.
struct HeldPeg {
  double x = 0;
  double y = 0;
  double theta = 0;
  double energy = 0;
  std::vector<std::array<double, 4>> series;  ///< Of the first seed: time, x, y, rotation.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(HeldPeg, x, y, theta, energy, series)

HeldPeg held(const Trace& trace, bool with_series) {
  const Pose X_W0 = peg_in_hole();
  const auto signal = [&](const Signal& s) { return window(trace, s, 0, 1e9); };
  HeldPeg outcome{
      .x = largest(
          signal([&](const server::TickRecord& t) { return std::abs(t.X_WD.p.x() - X_W0.p.x()); })),
      .y = peak_to_peak(signal([](const server::TickRecord& t) { return t.X_WD.p.y(); })),
      .theta = excursion(trace, X_W0).rotation,
      .energy = generated_energy(trace),
      .series = {}};
  for (std::size_t i = 0; with_series && i < trace.ticks.size(); i += 2) {
    const server::TickRecord& tick = trace.ticks[i];
    outcome.series.push_back(
        {tick.time, tick.X_WD.p.x(), tick.X_WD.p.y(), heading(tick.X_WD) - heading(X_W0)});
  }
  return outcome;
}

void add(HeldPegs& outcomes, const HeldPeg& outcome) {
  outcomes.x.push_back(outcome.x);
  outcomes.y.push_back(outcome.y);
  outcomes.theta.push_back(outcome.theta);
  outcomes.energy.push_back(outcome.energy);
  outcomes.unstable += outcome.energy > kUnstableEnergy;
  ++outcomes.trials;
}

std::map<std::string_view, HeldPegs> shake_all(Bench& bench, const std::string& figure,
                                               const Task& task,
                                               const std::vector<std::string>& names) {
  const std::vector<Job> jobs = bench.jobs(names, bench.seeds());
  const std::vector<HeldPeg> results = bench.map(jobs, [&](const Job& job) {
    return held(run({task, job.method, {}, job.seed}), job.seed == bench.seed());
  });
  std::map<std::string_view, HeldPegs> outcomes;
  Table& trials =
      bench.table(fmt::format("{}_trials", figure), "method,seed,x_m,y_m,theta_rad,energy_J");
  Table& series = bench.table(fmt::format("{}_series", figure), "method,time_s,x_m,y_m,theta_rad");
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const Method& method = jobs[i].method;
    const HeldPeg& o = results[i];
    add(outcomes[method.name], o);
    trials.row(method.label, static_cast<double>(jobs[i].seed), o.x, o.y, o.theta, o.energy);
    for (const auto& [time, x, y, theta] : o.series) series.row(method.label, time, x, y, theta);
  }
  return outcomes;
}

std::string described(const HeldPegs& o) {
  return fmt::format("x {} mm, θ {}°, y {} mm, {} of {} unstable, {} mJ", spread(o.x, 1e3),
                     spread(o.theta, kDegree), spread(o.y, 1e3), o.unstable, o.trials,
                     spread(o.energy, 1e3));
}

}  // namespace

void tight_hole(Bench& bench) {
  auto of = shake_all(bench, "fig16", hole_task(1, 4000, 30), {"ir", "lm0", "lm5", "shapes"});
  for (const char* name : {"lm5", "shapes"}) {
    const HeldPegs& o = of[name];
    if (o.trials == 0) continue;
    bench.claim({.what = fmt::format("16, {}", method(name).label),
                 .paper = "held by the hole: moves by what its stiffness allows",
                 .criterion = "x < 0.75 mm, θ < 1°, y < 0.5 mm peak to peak, all seeds",
                 .measured = described(o),
                 .holds = largest(o.x) < 0.75e-3 && largest(o.theta) * kDegree < 1 &&
                          largest(o.y) < 0.5e-3});
  }
  if (const HeldPegs& o = of["lm0"]; o.trials > 0) {
    bench.claim({.what = "16, LM₀",
                 .paper = "several mm, up to 20°",
                 .criterion = "median x > 3 mm, median θ > 3°",
                 .measured = described(o),
                 .holds = median(o.x) > 3e-3 && median(o.theta) * kDegree > 3});
  }
  if (!bench.complete()) return;
  bench.claim({.what = "16, LM₀ against LM₅",
               .paper = "the device is better constrained with ε-active geometry",
               .criterion = "median x at least 10 times as large",
               .measured = fmt::format("{:.1f} times", median(of["lm0"].x) / median(of["lm5"].x)),
               .holds = median(of["lm0"].x) >= 10 * median(of["lm5"].x)});
  bench.find(fmt::format("IR, Fig. 16: {}.", described(of["ir"])));
}

void stiff_hole(Bench& bench) {
  auto of = shake_all(bench, "fig17", hole_task(3, 15'000, 100), {"ir", "lm0", "lm5", "shapes"});
  if (const HeldPegs& o = of["ir"]; o.trials > 0) {
    bench.claim({.what = "17, IR",
                 .paper = "unstable",
                 .criterion = "unstable in all runs: gives out > 10 mJ in 2 s",
                 .measured = described(o),
                 .holds = o.unstable == o.trials});
  }
  for (const char* name : {"lm0", "lm5", "shapes"}) {
    const HeldPegs& o = of[name];
    if (o.trials == 0) continue;
    bench.claim({.what = fmt::format("17, {}", method(name).label),
                 .paper = "stable",
                 .criterion = "unstable in no run",
                 .measured = described(o),
                 .holds = o.unstable == 0});
  }
  const auto out =
      std::count_if(of["lm0"].y.begin(), of["lm0"].y.end(), [](double y) { return y > 0.04; });
  if (out > 0) {
    bench.find(
        fmt::format("LM₀ stays stable but drifts: in {} of {} runs the peg wandered more than "
                    "40 mm along the hole within {} s, pulled by no force but by contacts that are "
                    "placed late, each time a little elsewhere.",
                    out, of["lm0"].trials, 6));
  }
  if (!bench.complete()) return;
  const double further = median(of["lm0"].x) - median(of["lm5"].x);
  bench.claim({.what = "17, LM₀ less LM₅",
               .paper = "about 20 mm further along x",
               .criterion = "difference of the medians of x > 10 mm",
               .measured = fmt::format("{:.1f} mm", 1e3 * further),
               .holds = further > 10e-3});
}

}  // namespace hlm::experiments
