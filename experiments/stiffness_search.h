// The largest contact stiffness that a method bears in the hole, by either criterion.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "experiments/trial.h"

namespace hlm::experiments {

struct StiffnessLimit {
  double k_max = 0;  ///< N/m, within 10 %: stable there and at all scanned stiffnesses below.
  /// Stable up to the end of the scan: k_max is that end.
  bool beyond = false;
  /// Stable again at a scanned stiffness above one that was not.
  bool monotonous = true;
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StiffnessLimit, k_max, beyond, monotonous)

/// What counts as stable decides the limit, so both are reported.
struct StiffnessLimits {
  StiffnessLimit energy;  ///< Gives out no more than kUnstableEnergy.
  StiffnessLimit motion;  ///< Does not run away: the paper's sense.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StiffnessLimits, energy, motion)

/// The two, with the names that tables and pictures give them.
struct Criterion {
  const char* name;
  StiffnessLimit StiffnessLimits::*limit;
};
inline constexpr std::array<Criterion, 2> kCriteria{
    {{"energy", &StiffnessLimits::energy}, {"motion", &StiffnessLimits::motion}}};

/// Ends of the scan, N/m; it goes on by factors of two.
inline constexpr double kLeastStiffness = 125;
inline constexpr double kMostStiffness = 256'000;

/// Scans, then bisects between the last stable stiffness and the first unstable one. A stiffness
/// counts as stable if no trial of `seeds` seeds from `trial.seed` on is unstable.
StiffnessLimits find_stiffness_limits(const Trial& trial, int seeds);

/// "12.3 kN/m", with ">" beyond the scan and "*" where it is not monotonous.
std::string described(const StiffnessLimit& limit);

}  // namespace hlm::experiments
