#include "experiments/stiffness_search.h"

#include <cmath>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/hole_task.h"
#include "experiments/measures.h"

namespace hlm::experiments {
namespace {

/// Whether each criterion calls a stiffness stable.
struct Verdict {
  bool energy = true;
  bool motion = true;
};

/// Runs the trials at a stiffness once, for both criteria.
class Judge {
 public:
  Judge(const Trial& trial, int seeds) : trial_(trial), seeds_(seeds) {}

  bool operator()(double stiffness, bool Verdict::*criterion) {
    const auto [judged, is_new] = verdicts_.try_emplace(stiffness);
    if (is_new) judged->second = verdict(stiffness);
    return judged->second.*criterion;
  }

 private:
  Verdict verdict(double stiffness) const {
    Trial trial = trial_;
    trial.task.stiffness = stiffness;
    Verdict verdict;
    for (int i = 0; i < seeds_ && (verdict.energy || verdict.motion); ++i, ++trial.seed) {
      const Trace trace = run(trial);
      if (generated_energy(trace) > kUnstableEnergy) verdict.energy = false;
      if (runs_away(trace, peg_in_hole())) verdict.motion = false;
    }
    return verdict;
  }

  Trial trial_;
  int seeds_;
  std::map<double, Verdict> verdicts_;
};

StiffnessLimit find_limit(Judge& judge, bool Verdict::*criterion) {
  StiffnessLimit limit;
  double first_unstable = 0;
  // Two octaves beyond the first unstable stiffness show whether stability returns.
  for (double k = kLeastStiffness; k <= kMostStiffness; k *= 2) {
    if (first_unstable > 0 && k > 4 * first_unstable) break;
    const bool stable = judge(k, criterion);
    if (!stable && first_unstable == 0) first_unstable = k;
    if (stable && first_unstable == 0) limit.k_max = k;
    if (stable && first_unstable > 0) limit.monotonous = false;
  }
  limit.beyond = first_unstable == 0;
  if (limit.beyond || limit.k_max == 0) return limit;
  double high = first_unstable;
  while (high > 1.1 * limit.k_max) {
    const double middle = std::sqrt(limit.k_max * high);
    (judge(middle, criterion) ? limit.k_max : high) = middle;
  }
  return limit;
}

}  // namespace

StiffnessLimits find_stiffness_limits(const Trial& trial, int seeds) {
  Judge judge(trial, seeds);
  return {find_limit(judge, &Verdict::energy), find_limit(judge, &Verdict::motion)};
}

std::string described(const StiffnessLimit& limit) {
  if (limit.k_max == 0) return fmt::format("< {:.3g} kN/m", kLeastStiffness / 1000);
  return fmt::format("{}{:.3g} kN/m{}", limit.beyond ? "> " : "", limit.k_max / 1000,
                     limit.monotonous ? "" : "*");
}

}  // namespace hlm::experiments
