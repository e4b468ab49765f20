#include "tests/experiments/stiffness_search.h"

#include <cmath>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/measures.h"

namespace hlm::experiments {
namespace {

bool is_stable(Trial trial, double stiffness, int seeds) {
  trial.task.stiffness = stiffness;
  for (int i = 0; i < seeds; ++i, ++trial.seed) {
    if (unstable(run(trial))) return false;
  }
  return true;
}

}  // namespace

StiffnessLimit find_stiffness_limit(Trial trial, int seeds) {
  StiffnessLimit limit;
  double first_unstable = 0;
  // Two octaves beyond the first unstable stiffness show whether stability returns.
  for (double k = kLeastStiffness; k <= kMostStiffness; k *= 2) {
    if (first_unstable > 0 && k > 4 * first_unstable) break;
    const bool stable = is_stable(trial, k, seeds);
    if (!stable && first_unstable == 0) first_unstable = k;
    if (stable && first_unstable == 0) limit.k_max = k;
    if (stable && first_unstable > 0) limit.monotonous = false;
  }
  limit.beyond = first_unstable == 0;
  if (limit.beyond || limit.k_max == 0) return limit;
  double high = first_unstable;
  while (high > 1.1 * limit.k_max) {
    const double middle = std::sqrt(limit.k_max * high);
    (is_stable(trial, middle, seeds) ? limit.k_max : high) = middle;
  }
  return limit;
}

std::string described(const StiffnessLimit& limit) {
  if (limit.k_max == 0) return fmt::format("< {:.3g} kN/m", kLeastStiffness / 1000);
  return fmt::format("{}{:.3g} kN/m{}", limit.beyond ? "> " : "", limit.k_max / 1000,
                     limit.monotonous ? "" : "*");
}

}  // namespace hlm::experiments
