// Numbers drawn from a trace.
#pragma once

#include <functional>
#include <vector>

#include "tests/experiments/trial.h"

namespace hlm::experiments {

using Signal = std::function<double(const server::TickRecord&)>;

/// Rotation about z against the world, rad, in (-π, π].
double heading(const Pose& X) noexcept;

/// Ticks with from <= time < to.
std::vector<double> window(const Trace& trace, const Signal& signal, double from, double to);

double mean(const std::vector<double>& values);
double median(std::vector<double> values);
/// Value below which the portion p of all values lies. Requires at least one value.
double quantile(std::vector<double> values, double p);
double largest(const std::vector<double>& values);
/// Largest less smallest.
double peak_to_peak(const std::vector<double>& values);

/// Largest distance of the handle from X_W0: displacement, m, and rotation, rad.
struct Excursion {
  double distance = 0;
  double rotation = 0;
};
Excursion excursion(const Trace& trace, const Pose& X_W0);

/// The most energy that motors, coupling and contacts have given handle and proxy on balance, up to
/// any moment, J. Passive ones, met at rest, never give any. (To the handle alone four channels do:
/// in free motion the hand's wrench on the proxy draws the handle along.)
double delivered_energy(const Trace& trace);

/// Where a trial counts as unstable: energy out of nothing, J. Stable methods stay below 1 mJ, that
/// of unstable ones grows until forces saturate.
inline constexpr double kUnstableEnergy = 0.01;
inline bool unstable(const Trace& trace) { return delivered_energy(trace) > kUnstableEnergy; }

}  // namespace hlm::experiments
