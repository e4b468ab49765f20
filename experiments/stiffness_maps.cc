// k_max of each method over rates, delay, jitter, loss and the device's delay.
#include <cmath>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "experiments/hole_task.h"
#include "experiments/stiffness_search.h"

namespace hlm::experiments {
namespace {

constexpr double kCellPush = 3;       // N
constexpr double kCellDamping = 100;  // N·s/m
constexpr double kCellDuration = 3;   // s

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

struct Place {
  const Axis* axis;
  double value;
  Method method;
};

/// Colgate's bound for an undelayed wall on the device itself: k < 2 b_device / Δt, without virtual
/// damping (of which the bound allows none beyond the device's own).
double colgate(const Trial& trial) {
  return 2 * trial.task.device.damping * trial.conditions.servo_rate;
}

Trial trial_of(const Bench& bench, const Place& place) {
  Trial trial{hole_task(kCellPush, 0, kCellDamping, kCellDuration), place.method, {}, bench.seed()};
  place.axis->set(trial, place.value);
  return trial;
}

/// Limits by value of the axis and method.
using Map = std::map<double, std::map<std::string_view, StiffnessLimits>>;

/// Whether the search found a limit, not an end of its scan.
bool is_found(const StiffnessLimit& limit) { return limit.k_max > 0 && !limit.beyond; }

/// Slope of log k_max by motion over log age, age = round trip + one mean period: as old is the
/// state to which a report of the walls belongs when the next one replaces it.
struct Fit {
  double slope = 0;
  std::size_t points = 0;
  std::string text;  ///< What was fitted.
};

/// Least squares over the delays at which a limit was found: an end of the scan is none.
Fit fit_over_age(Map& delay, std::string_view method) {
  constexpr double kMeanPeriod = 1.0 / 45;  // s
  std::vector<double> x, y;
  Fit fit;
  for (auto& [ms, limits] : delay) {
    const StiffnessLimit& limit = limits[method].motion;
    fit.text +=
        fmt::format("{}{} at {:.0f} ms", fit.text.empty() ? "" : ", ", described(limit), ms);
    if (!is_found(limit)) continue;
    x.push_back(std::log(2e-3 * ms + kMeanPeriod));
    y.push_back(std::log(limit.k_max));
  }
  double xy = 0;
  double xx = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean(x)) * (y[i] - mean(y));
    xx += (x[i] - mean(x)) * (x[i] - mean(x));
  }
  fit.points = x.size();
  fit.slope = xx > 0 ? xy / xx : 0;
  return fit;
}

}  // namespace

void stiffness_maps(Bench& bench) {
  std::vector<Place> places;
  const std::vector<Method> compared =
      bench.methods({"ir", "ir-rot", "vrpn", "coupler", "engine", "lm0", "lm5", "shapes",
                     "lm5-direct", "lm5-coupler", "ir-four"});
  for (const Axis& axis : axes()) {
    for (const double value : axis.values) {
      for (const Method& method : compared) places.push_back({&axis, value, method});
    }
  }
  const auto inputs_of = [](const Place& place) {
    return Inputs{{"method", place.method.name}, {place.axis->name, place.value}};
  };
  const std::vector<StiffnessLimits> found = bench.map(places, inputs_of, [&](const Place& place) {
    return find_stiffness_limits(trial_of(bench, place), 3);
  });

  Table& table =
      bench.table("maps", "axis,unit,value,method,criterion,k_max,beyond,monotonous,colgate");
  std::map<std::string_view, Map> limits;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& [axis, value, method] = places[i];
    limits[axis->name][value][method.name] = found[i];
    for (const Criterion& criterion : kCriteria) {
      const StiffnessLimit& limit = found[i].*criterion.limit;
      table.row(axis->name, axis->unit, value, method.label, criterion.name, limit.k_max,
                limit.beyond ? 1.0 : 0.0, limit.monotonous ? 1.0 : 0.0,
                colgate(trial_of(bench, places[i])));
    }
  }
  if (!bench.complete()) return;
  Map& delay = limits["delay"];
  // With direct coupling, whose limit lies within the scan; with four channels it is beyond.
  const StiffnessLimit& near = delay[0]["lm5-direct"].energy;
  const StiffnessLimit& far = delay[200]["lm5-direct"].energy;
  bench.claim({.what = "k_max of LM₅ (direct) over network delay",
               .criterion = "by energy, falls by less than half from 0 to 200 ms",
               .measured = fmt::format("{} at 0 ms, {} at 200 ms", described(near), described(far)),
               .holds = is_found(near) && far.k_max > 0.5 * near.k_max &&
                        near.k_max > delay[0]["ir"].energy.k_max});
  const Fit fit = fit_over_age(delay, "ir");
  bench.claim({.what = "k_max of IR over network delay",
               .criterion =
                   "by motion, falls as 1/age: slope of log k_max over log (round trip + "
                   "mean period) between -0.7 and -1.3, of the limits found, three or more",
               .measured = fmt::format("{:.2f} over {} of: {}", fit.slope, fit.points, fit.text),
               .holds = fit.points >= 3 && std::abs(fit.slope + 1) < 0.3});
  if (delay[200]["ir"].motion.k_max > delay[100]["ir"].motion.k_max)
    bench.find(
        "At 200 ms the environment is late by half a period of the hand's 2.5 Hz: IR's walls come "
        "when the peg is on its way back, and bear more than at 100 ms.");
}

}  // namespace hlm::experiments
