#include "experiments/measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace hlm::experiments {

double heading(const Pose& X) noexcept { return rotation_vector(X.R).z(); }

std::vector<double> window(const Trace& trace, const Signal& signal, double from, double to) {
  std::vector<double> values;
  for (const server::TickRecord& tick : trace.ticks) {
    if (tick.time >= from && tick.time < to) values.push_back(signal(tick));
  }
  return values;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

double quantile(std::vector<double> values, double p) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = static_cast<std::ptrdiff_t>(p * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double largest(const std::vector<double>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

double peak_to_peak(const std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return *high - *low;
}

Excursion excursion(const Trace& trace, const Pose& X_W0) {
  Excursion result;
  for (const server::TickRecord& tick : trace.ticks) {
    const Vector6 e = displacement(X_W0, tick.X_WD);
    result.distance = std::max(result.distance, e.head<3>().norm());
    result.rotation = std::max(result.rotation, e.tail<3>().norm());
  }
  return result;
}

bool runs_away(const Trace& trace, const Pose& X_W0) {
  if (trace.broken) return true;
  return std::ranges::any_of(trace.ticks, [&](const server::TickRecord& tick) {
    const double distance = (tick.X_WD.p - X_W0.p).norm();
    return !(tick.V_WD.head<3>().norm() <= kUnstableSpeed && distance <= kOutOfHole);
  });
}

double generated_energy(const Trace& trace) {
  if (trace.broken) return std::numeric_limits<double>::infinity();
  const bool hand_on_proxy = trace.controller == ControllerKind::kFourChannel;
  const auto delay = static_cast<std::size_t>(trace.device_delay);
  std::vector<double> given{0};  // J, at each tick, since the first
  double work = 0;
  for (std::size_t i = 1; i < trace.ticks.size(); ++i) {
    // A tick's record has the device at its beginning, the proxy at its end.
    const server::TickRecord& before = trace.ticks[i - 1];
    const server::TickRecord& now = trace.ticks[i];
    if (i > delay) {
      work += trace.ticks[i - 1 - delay].F_command.dot(displacement(before.X_WD, now.X_WD));
    }
    if (hand_on_proxy) work -= now.F_hand.dot(displacement(before.X_WP, now.X_WP));
    given.push_back(work + trace.internal_energy[i] - trace.internal_energy[0]);
    if (!std::isfinite(given.back())) return std::numeric_limits<double>::infinity();
  }
  const double dt = trace.ticks[1].time - trace.ticks[0].time;
  const auto window = static_cast<std::size_t>(kEnergyWindow / dt + 0.5);
  double most = 0;
  for (std::size_t i = 0; i + window < given.size(); ++i) {
    most = std::max(most, given[i + window] - given[i]);
  }
  return most;
}

}  // namespace hlm::experiments
