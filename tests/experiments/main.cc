// experiments: runs the paper's experiments in virtual time and writes their tables and claims.
#include <algorithm>
#include <iostream>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <spdlog/fmt/fmt.h>

#include "hlm/control/controller.h"
#include "hlm/local_model/parameters.h"
#include "tests/experiments/experiments.h"

namespace hlm::experiments {
namespace {

struct Experiment {
  const char* name;
  void (*run)(Bench&);
  bool quick;  ///< Part of --quick.
};

constexpr Experiment kExperiments[] = {
    {"fig06", one_dof_hole_unstable, true},
    {"fig09", one_dof_hole_delay, true},
    {"fig14", static_contact, true},
    {"fig16", tight_hole, true},
    {"fig17", stiff_hole, true},
    {"updates", updates, true},
    {"limits", stiffness_limits, true},
    {"observer", hand_observer, true},
    {"spatial", spatial, true},
    {"collisions", collisions, true},
    {"linkages", linkages, true},
    {"corners", corners, true},
    {"shapes", near_shapes, true},
    {"ocean", ocean, true},
    {"roams", roams, true},
    {"posts", posts, true},
    {"bodies", bodies, true},
    {"bodylimits", body_limits, false},
    {"holding", holding, true},
    {"external", external, true},
    {"audit", audit, true},
    {"twotools", two_tools, true},
    {"scenes", scenes, true},
    {"approach", approach_map, true},
    {"maps", stiffness_maps, false},
};

bool wanted(const BenchOptions& options, const Experiment& experiment) {
  if (options.only.empty()) return experiment.quick || !options.quick;
  return std::find(options.only.begin(), options.only.end(), experiment.name) != options.only.end();
}

void write_claims(Bench& bench) {
  Table& claims = bench.table("claims", "experiment,what,paper,criterion,measured,holds");
  for (const Claim& c : bench.claims()) {
    claims.row(c.experiment, c.what, c.paper, c.criterion, c.measured, c.holds ? 1.0 : 0.0);
  }
  Table& findings = bench.table("findings", "experiment,text");
  for (const Finding& f : bench.findings()) findings.row(f.experiment, f.text);
}

std::string arguments(const BenchOptions& options, int seeds) {
  std::string text = fmt::format("--seed {} --seeds {}", options.seed, seeds);
  for (const std::string& name : options.methods) text.append(" --method ").append(name);
  if (options.quick) text.append(" --quick");
  return text;
}

void write_parameters(Bench& bench, const BenchOptions& options) {
  const Conditions conditions;
  const Task task;
  const server::ControllerGains gains;
  const server::LocalModelParameters local;
  Table& table = bench.table("parameters", "name,value");
  const auto row = [&](std::string_view name, std::string_view value) { table.row(name, value); };
  row("arguments", arguments(options, bench.seeds()));
  row("loop", fmt::format("{} Hz where nothing else is said", conditions.servo_rate));
  row("environment",
      fmt::format("{} to {} Hz, the rate of each frame drawn; ODE; the tool is carried "
                  "along with the proxy (couplings to the engine: drawn by their spring)",
                  conditions.ve_low, conditions.ve_high));
  row("network", fmt::format("{} ms one way", 1e3 * conditions.link.delay));
  row("device",
      fmt::format("{} kg, {} kg·m², {} N·s/m, {} N·m·s/rad, dry friction {} N, at most {} N",
                  task.device.mass, task.device.inertia, task.device.damping,
                  task.device.angular_damping, task.device.dry_friction, task.device.max_force));
  row("proxy and tool", "1 kg, 80 x 40 mm; hole 80 mm deep, exactly fitting");
  row("controller",
      fmt::format("K_c {} N/m, {} N·m/rad; B_c {} N·s/m, {} N·m·s/rad", gains.stiffness,
                  gains.angular_stiffness, gains.damping, gains.angular_damping));
  row("contacts",
      fmt::format("friction {}, restitution {}, implicit step, non-negative impulses; load "
                  "released by {} N a step, no healing (except of bodies); VE contact tolerance 0",
                  task.friction, local.restitution, local.release_step));
  row("seed",
      "draws the moment at which the hand begins, the rates of frames, the network, and the point "
      "at which the hand pushes");
}

/// Throws std::runtime_error naming what is unknown.
void check_names(const BenchOptions& options) {
  for (const std::string& name : options.methods) method(name);
  for (const std::string& name : options.only) {
    std::string known;
    for (const Experiment& experiment : kExperiments) {
      known += (known.empty() ? "" : ", ") + std::string(experiment.name);
      if (name == experiment.name) known.clear();
      if (known.empty()) break;
    }
    if (!known.empty()) {
      throw std::runtime_error("experiment '" + name + "' must be one of " + known);
    }
  }
}

int run_experiments(const BenchOptions& options) {
  check_names(options);
  Bench bench(options);
  const auto count = std::count_if(std::begin(kExperiments), std::end(kExperiments),
                                   [&](const Experiment& e) { return wanted(options, e); });
  std::size_t number = 0;
  for (const Experiment& experiment : kExperiments) {
    if (!wanted(options, experiment)) continue;
    bench.begin(experiment.name, ++number, static_cast<std::size_t>(count));
    experiment.run(bench);
    bench.close_tables();
  }
  write_parameters(bench, options);
  write_claims(bench);
  bench.close_tables();
  const auto failed = std::count_if(bench.claims().begin(), bench.claims().end(),
                                    [](const Claim& claim) { return !claim.holds; });
  fmt::print("{} of {} criteria hold\n", bench.claims().size() - static_cast<std::size_t>(failed),
             bench.claims().size());
  return failed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace hlm::experiments

int main(int argc, char** argv) {
  hlm::experiments::BenchOptions options;
  CLI::App app{"The paper's experiments, in virtual time."};
  app.add_flag("--quick", options.quick, "Fewer seeds and cases");
  app.add_option("--only", options.only, "Only these experiments");
  app.add_option("--method", options.methods,
                 "Only these methods; claims across methods are left out");
  app.add_option("--seed", options.seed, "First seed")->capture_default_str();
  app.add_option("--seeds", options.seeds, "Number of seeds, one run each; 0: 20, with --quick 5")
      ->check(CLI::Range(0, 10000))
      ->capture_default_str();
  app.add_option("--jobs", options.jobs, "Threads; 0: as many as cores")->capture_default_str();
  app.add_option("--out", options.out, "Folder for the tables")->capture_default_str();
  try {
    app.parse(argc, argv);
    return hlm::experiments::run_experiments(options);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "experiments: " << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "experiments: " << error.what() << '\n';
    return 2;
  }
}
