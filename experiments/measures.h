// Numbers drawn from a trace.
#pragma once

#include <functional>
#include <numbers>
#include <vector>

#include "experiments/trial.h"

namespace hlm::experiments {

using Signal = std::function<double(const server::TickRecord&)>;

inline constexpr double kDegree = 180 / std::numbers::pi;  ///< Of a radian.

/// Rotation about z against the world, rad, in (-π, π].
double heading(const Pose& X) noexcept;

/// Ticks with from <= time < to.
std::vector<double> window(const Trace& trace, const Signal& signal, double from, double to);

double mean(const std::vector<double>& values);
double median(std::vector<double> values);
/// Value below which the portion p of all values lies; NaN of none.
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

/// The most energy that the virtual side (motors, coupling, proxy, contacts with their springs) has
/// given out in any kEnergyWindow, J: a passive one gives none out of nothing, and what it stores
/// over a period of the hand it has given back by the next. Infinite for a trial that broke off.
double generated_energy(const Trace& trace);

/// Whole periods of the hand's 2.5 Hz, s: long enough that a transient counts little, short enough
/// that what was absorbed long before does not pay for what is generated.
inline constexpr double kEnergyWindow = 2;

/// Where a trial counts as unstable by its energy, J in the window: 5 mW on average.
inline constexpr double kUnstableEnergy = 0.01;

/// Where a trial in the hole counts as unstable by its motion: the handle faster than this, m/s,
/// which the hand alone does not make it, or farther from where it began, m: out of the hole, which
/// is as deep.
inline constexpr double kUnstableSpeed = 1;
inline constexpr double kOutOfHole = 0.08;
/// `X_W0`: the handle's pose at the beginning.
bool runs_away(const Trace& trace, const Pose& X_W0);

}  // namespace hlm::experiments
