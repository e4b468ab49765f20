// What the hand holds, against a world without delay (docs/method.md 21).
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/body_tasks.h"
#include "experiments/experiments.h"

namespace hlm::experiments {
namespace {

/// What is done, and from when on, s, it is compared.
struct Deed {
  std::string name;
  BodyTask task;
};

/// By which runs may differ in length, s: a frame, and a hello that is lost.
constexpr double kFrames = 0.25;
/// Of a session that has ended, N and m.
constexpr double kLost = 1e3;

/// A wait in which the server has the scene, whatever the delay, s.
constexpr double kWait = 3;

std::vector<Deed> deeds(bool quick) {
  std::vector<Deed> all{{"cube", carry_tower(1)},
                        {"tower of 5", carry_tower(5)},
                        {"2 kg on 50 g", carry_on_plate(0.05, 2)},
                        {"thrown", throw_up(0.3)},
                        {"brick", slide({})},
                        {"brick on brick", slide_two(0.375)},
                        {"pressed tower of 5", rest_on_cubes(5, 0.3, 0.3)}};
  if (!quick) {
    all.push_back({"tower of 2", carry_tower(2)});
    all.push_back({"tower of 8", carry_tower(8)});
    all.push_back({"pressed tower of 8", rest_on_cubes(8, 0.3, 0.3)});
    all.push_back({"tower 1:100", rest_on_cubes(3, 0.03, 3)});
    all.push_back({"tower 100:1", rest_on_cubes(3, 3, 0.03)});
  }
  for (Deed& deed : all) deed.task = later(deed.task, kWait);
  return all;
}

/// Against the world without delay.
struct Difference {
  double rms = 0;       ///< Of the force, N.
  double most = 0;      ///< N.
  double mean = 0;      ///< Of the mean over the last 0.5 s, N.
  double step = 0;      ///< Largest in a tick, N,
  double step_due = 0;  ///< and without delay.
  double away = 0;      ///< Of the watched body in the engine, at the end, m.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Difference, rms, most, mean, step, step_due, away)

/// Runs from the beginning of their session on. A stall takes ticks away.
Difference compare(const std::vector<BodySample>& samples, const std::vector<BodySample>& due) {
  const double end = std::min(samples.back().time, due.back().time);
  if (end < due.back().time - kFrames) return {.mean = kLost, .away = kLost};
  Difference d;
  Vector3 sum = Vector3::Zero();
  int count = 0;
  int last = 0;  // Of them in the last half second.
  const BodySample* before = nullptr;
  for (const BodySample& sample : samples) {
    if (sample.time < kWait + 0.3 || sample.time > end) continue;
    const auto at = std::ranges::lower_bound(due, sample.time - 1e-6, {}, &BodySample::time);
    const Vector3 F = sample.F_env.head<3>();
    const Vector3 F_due = at->F_env.head<3>();
    const double off = (F - F_due).norm();
    d.rms += off * off;
    d.most = std::max(d.most, off);
    if (before != nullptr) {
      d.step = std::max(d.step, (F - before->F_env.head<3>()).norm());
      d.step_due = std::max(d.step_due, (F_due - (at - 1)->F_env.head<3>()).norm());
    }
    before = &sample;
    ++count;
    if (sample.time < end - 0.5) continue;
    sum += F - F_due;
    ++last;
  }
  d.rms = std::sqrt(d.rms / count);
  d.mean = sum.norm() / last;
  d.away = (samples.back().X_WB.p - due.back().X_WB.p).norm();
  return d;
}

BodyConditions undelayed(const BodyConditions& c) {
  BodyConditions due = c;
  due.ve_rate = 240;
  due.delay = due.loss = 0;
  due.outage = {};
  due.stalls = {};
  return due;
}

Difference play(const Deed& deed, const BodyConditions& c, std::uint64_t seed) {
  return compare(run(deed.task, c, seed), run(deed.task, undelayed(c), seed));
}

std::vector<BodyConditions> grid(bool quick) {
  std::vector<BodyConditions> all;
  for (const double k : {4000.0, 16000.0, 50000.0}) {
    for (const double rate : {15.0, 30.0, 60.0, 240.0}) {
      for (const double delay : {0.0, 0.02, 0.1, 0.5}) {
        const bool seldom = k != 4000 || rate == 240 || rate == 30;
        if (quick && seldom) continue;
        all.push_back({.ve_rate = rate, .delay = delay, .stiffness = k, .shapes = true});
      }
    }
  }
  for (const double loss : {0.1, 0.2}) {
    all.push_back({.delay = 0.02, .loss = loss, .shapes = true});
  }
  for (const double duration : {0.1, 0.5, 1.0}) {
    all.push_back(
        {.delay = 0.02, .shapes = true, .outage = {.begin = kWait + 1.5, .duration = duration}});
  }
  all.push_back({.delay = 0.02, .shapes = true, .stalls = {.shortest = 0.03, .longest = 0.03}});
  return all;
}

}  // namespace

void held(Bench& bench) {
  Table& table = bench.table("held",
                             "task,ve_rate_Hz,delay_s,stiffness,loss,outage_s,stall_s,rms_N,most_N,"
                             "mean_N,step_N,step_due_N,away_m");
  Difference most;
  for (const Deed& deed : deeds(bench.quick())) {
    const std::vector<BodyConditions> conditions = grid(bench.quick());
    const auto outcomes = bench.map(
        conditions,
        [&](const BodyConditions& c) {
          return Inputs{{"task", deed.name},
                        {"outage_s", std::isfinite(c.outage.begin) ? c.outage.duration : 0}} +
                 inputs_of(c);
        },
        [&](const BodyConditions& c) { return play(deed, c, bench.seed()); });
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const BodyConditions& c = conditions[i];
      const Difference& d = outcomes[i];
      table.row(deed.name, c.ve_rate, c.delay, c.stiffness, c.loss,
                std::isfinite(c.outage.begin) ? c.outage.duration : 0.0, c.stalls.longest, d.rms,
                d.most, d.mean, d.step, d.step_due, d.away);
      most.mean = std::max(most.mean, d.mean);
      most.step = std::max(most.step, d.step - d.step_due);
      most.away = std::max(most.away, d.away);
    }
  }
  bench.claim(
      {.what = "What the hand holds",
       .criterion = "cubes and towers that are carried, pressed and put down, thrown, a load "
                    "on a plate, bricks that are pushed, against a world without delay: "
                    "mean force over the last half second within 0.1 N, no step in a tick "
                    "above its own by 0.6 N, bodies at the end within 1 mm, at 15 to 240 "
                    "Hz, 0 to 500 ms each way, 10 and 20 % lost, outages of 0.1 to 1 s, "
                    "stalls of 30 ms",
       .measured =
           fmt::format("{:.2g} N, {:.2g} N, {:.2g} mm", most.mean, most.step, 1e3 * most.away),
       .holds = most.mean <= 0.1 && most.step <= 0.6 && most.away <= 1e-3});
}

}  // namespace hlm::experiments
