// What an update does to the force: its jump, and the energy that it puts into the springs, while
// the peg is shaken in its hole with 1 N.
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "experiments/hole_task.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::experiments {
namespace {

/// Just noticeable difference of a force of the size of the hand's, N: 10 %.
constexpr double kJustNoticeable = 0.1;

/// Of each update.
struct Effects {
  std::vector<double> jump;    ///< Of the resultant force, N.
  std::vector<double> rise;    ///< Largest of one contact, N.
  std::vector<double> fall;    ///< Largest of one contact, N.
  std::vector<double> energy;  ///< Stored, J.
};

}  // namespace

void updates(Bench& bench) {
  const std::vector<std::string> names{"ir", "vrpn", "lm0-paper", "lm5-paper", "lm0", "lm5"};
  const std::vector<Job> jobs = bench.jobs(names, bench.seeds());
  const Task task = hole_task(1, 4000, 30);
  const auto found = bench.map(jobs, [&](const Job& job) {
    return run({task, job.method, {}, job.seed}).updates;
  });

  std::map<std::string_view, Effects> of;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    for (const UpdateEffect& effect : found[i]) {
      of[jobs[i].method.name].jump.push_back(effect.force);
      of[jobs[i].method.name].rise.push_back(effect.rise);
      of[jobs[i].method.name].fall.push_back(effect.fall);
      of[jobs[i].method.name].energy.push_back(effect.energy);
    }
  }
  Table& table =
      bench.table("updates", "method,largest_jump_N,p99_jump_N,noticeable_share,largest_energy_J");
  for (const Method& method : bench.methods(names)) {
    const Effects& e = of[method.name];
    double noticeable = 0;
    for (const double jump : e.jump) noticeable += jump > kJustNoticeable;
    table.row(method.label, largest(e.jump), quantile(e.jump, 0.99),
              noticeable / static_cast<double>(e.jump.size()), largest(e.energy));
    const UpdateRuleTraits rule = traits(method.update_rule);
    if (!rule.keeps_deformation) continue;
    // Retained load is released from the very step of the update on.
    const double bound = server::LocalModelParameters{}.release_step;
    std::string criterion =
        "no update stores energy (> 1e-9 J) or raises a contact's spring force "
        "(> 1e-6 N)";
    if (rule.releases_load) criterion += fmt::format(", nor lowers one by more than {} N", bound);
    bench.claim({.what = fmt::format("Updates, {}", method.label),
                 .paper = "penetration is continuous at updates",
                 .criterion = criterion,
                 .measured = fmt::format("{:.1e} J; rises {:.1e} N, falls {:.3g} N at most",
                                         largest(e.energy), largest(e.rise), largest(e.fall)),
                 .holds = largest(e.energy) <= 1e-9 && largest(e.rise) <= 1e-6 &&
                          (!rule.releases_load || largest(e.fall) <= bound + 1e-6)});
  }
  if (const Effects& e = of["ir"]; !e.jump.empty()) {
    bench.find(fmt::format(
        "IR: updates change the force by up to {:.3g} N (99 % below {:.3g} N) and store "
        "up to {:.3g} mJ each.",
        largest(e.jump), quantile(e.jump, 0.99), 1e3 * largest(e.energy)));
  }
}

}  // namespace hlm::experiments
