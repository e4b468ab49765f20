// k_max of each method over rates, delay, jitter, loss and the device's delay.
#include <cmath>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/experiments.h"
#include "tests/experiments/hole_task.h"
#include "tests/experiments/stiffness_search.h"

namespace hlm::experiments {
namespace {

constexpr double kPush = 3;       // N
constexpr double kDamping = 100;  // N·s/m
constexpr double kDuration = 3;   // s

/// One condition that is varied, the others as in Conditions.
struct Axis {
  std::string name;
  std::string unit;
  std::vector<double> values;
  void (*set)(Trial& trial, double value);
};

void set_ve_rate(Trial& t, double hz) { t.conditions.ve_low = t.conditions.ve_high = hz; }
void set_delay(Trial& t, double ms) { t.conditions.link.delay = 1e-3 * ms; }
void set_jitter(Trial& t, double ms) { t.conditions.link.jitter = 1e-3 * ms; }
void set_loss(Trial& t, double percent) { t.conditions.link.loss = 0.01 * percent; }
void set_device_delay(Trial& t, double ticks) { t.task.device.delay = static_cast<int>(ticks); }
void set_servo_rate(Trial& t, double hz) { t.conditions.servo_rate = hz; }
/// At 50 ms one way: at the usual 2 ms the acknowledgement is always back before the next frame.
void set_waiting(Trial& t, double waits) {
  t.conditions.link.delay = 0.05;
  t.conditions.waits = waits > 0;
}

const std::vector<Axis>& axes() {
  static const std::vector<Axis> all{
      {"ve_rate", "Hz", {10, 20, 30, 60, 120}, set_ve_rate},
      {"delay", "ms", {0, 10, 20, 50, 100, 200}, set_delay},
      {"jitter", "ms", {0, 5, 10, 20}, set_jitter},
      {"loss", "%", {0, 5, 10, 20, 30}, set_loss},
      {"device_delay", "ticks", {0, 1, 2}, set_device_delay},
      {"servo_rate", "Hz", {512, 1000, 2000, 4000}, set_servo_rate},
      {"waits_for_acknowledgement", "", {0, 1}, set_waiting},
  };
  return all;
}

struct Cell {
  const Axis* axis;
  double value;
  Method method;
};

/// Colgate's bound for an undelayed wall on the device itself: k < 2 b_device / Δt, without virtual
/// damping (of which the bound allows none beyond the device's own).
double colgate(const Trial& trial) {
  return 2 * trial.task.device.damping * trial.conditions.servo_rate;
}

Trial trial_of(const Bench& bench, const Cell& cell) {
  Trial trial{hole_task(kPush, 0, kDamping, kDuration), cell.method, {}, bench.seed()};
  cell.axis->set(trial, cell.value);
  return trial;
}

/// k_max by value of the axis and method.
using Map = std::map<double, std::map<std::string_view, double>>;

/// Least-squares slope of log k_max over log age, age = delay + one mean period.
double slope_over_age(Map& delay, const std::string& method) {
  constexpr double kMeanPeriod = 1.0 / 45;  // s
  std::vector<double> x, y;
  for (auto& [ms, k_max] : delay) {
    x.push_back(std::log(1e-3 * ms + kMeanPeriod));
    y.push_back(std::log(std::max(k_max[method], kLeastStiffness)));
  }
  double xy = 0;
  double xx = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean(x)) * (y[i] - mean(y));
    xx += (x[i] - mean(x)) * (x[i] - mean(x));
  }
  return xy / xx;
}

}  // namespace

void stiffness_maps(Bench& bench) {
  std::vector<Cell> cells;
  const std::vector<Method> compared =
      bench.methods({"ir", "ir-rot", "vrpn", "coupler", "engine", "lm0", "lm5", "lm-adaptive",
                     "lm5-direct", "lm5-coupler", "ir-four"});
  for (const Axis& axis : axes()) {
    for (const double value : axis.values) {
      for (const Method& method : compared) cells.push_back({&axis, value, method});
    }
  }
  const std::vector<StiffnessLimit> found = bench.map(
      cells, [&](const Cell& cell) { return find_stiffness_limit(trial_of(bench, cell), 3); });

  Table& table =
      bench.table("maps", "axis,unit,value,method,k_max,ratio_to_ir,beyond,monotonous,colgate");
  std::map<std::string_view, Map> k_max;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto& [axis, value, method] = cells[i];
    auto& at = k_max[axis->name][value];
    at[method.name] = found[i].k_max;
    table.row(axis->name, axis->unit, value, method.label, found[i].k_max,
              found[i].k_max / std::max(at["ir"], 1.0), found[i].beyond ? 1.0 : 0.0,
              found[i].monotonous ? 1.0 : 0.0, colgate(trial_of(bench, cells[i])));
  }
  if (!bench.complete()) return;
  Map& delay = k_max["delay"];
  // With direct coupling, whose limit lies within the scan; with four channels it is beyond.
  const double kept = delay[200]["lm5-direct"] / delay[0]["lm5-direct"];
  bench.claim(
      {.what = "k_max of LM₅ (direct) over network delay",
       .criterion = "falls by less than half from 0 to 200 ms",
       .measured = fmt::format("{:.0f} N/m at 0 ms, {:.0f} N/m at 200 ms: {:.0f} % is left",
                               delay[0]["lm5-direct"], delay[200]["lm5-direct"], 100 * kept),
       .holds = kept > 0.5 && delay[0]["lm5-direct"] > delay[0]["ir"]});
  bench.claim({.what = "k_max of IR over network delay",
               .criterion = "falls as 1/age: slope of log k_max over log (delay + mean period) "
                            "between -0.7 and -1.3",
               .measured = fmt::format("{:.2f}; {:.0f} N/m at 0 ms, {:.0f} N/m at 100 ms, {:.0f} "
                                       "N/m at 200 ms",
                                       slope_over_age(delay, "ir"), delay[0]["ir"],
                                       delay[100]["ir"], delay[200]["ir"]),
               .holds = std::abs(slope_over_age(delay, "ir") + 1) < 0.3});
  if (delay[200]["ir"] > delay[100]["ir"])
    bench.find(
        "At 200 ms the environment is late by half a period of the hand's 2.5 Hz: IR's walls come "
        "when the peg is on its way back, and bear more than at 100 ms.");
}

}  // namespace hlm::experiments
