#include "tests/experiments/measures.h"

#include <algorithm>
#include <cmath>
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

namespace {

/// What contacts and coupling do to a proxy with dynamics of its own. A device in the proxy's place
/// has none.
Wrench wrench_on_proxy(server::ControllerKind controller, const server::TickRecord& tick) {
  using server::ControllerKind;
  switch (controller) {
    case ControllerKind::kFourChannel:
    case ControllerKind::kThreeChannel:  // F_command = F_env - coupling
      return tick.F_env + (tick.F_env - tick.F_command);
    case ControllerKind::kVirtualCoupler:  // F_command = -coupling
      return tick.F_env - tick.F_command;
    case ControllerKind::kDirect:
    case ControllerKind::kRotationCoupler:
    case ControllerKind::kEngineCoupler:
    case ControllerKind::kEngineForce:
      return Wrench::Zero();
  }
  return Wrench::Zero();
}

}  // namespace

double delivered_energy(const Trace& trace) {
  double energy = 0;
  double most = 0;
  for (std::size_t i = 1; i < trace.ticks.size(); ++i) {
    const server::TickRecord& before = trace.ticks[i - 1];
    const server::TickRecord& now = trace.ticks[i];
    // A tick's record has the device at its beginning, the proxy at its end.
    energy += before.F_command.dot(displacement(before.X_WD, now.X_WD)) +
              wrench_on_proxy(trace.controller, now).dot(displacement(before.X_WP, now.X_WP));
    most = std::max(most, energy);
  }
  return most;
}

}  // namespace hlm::experiments
