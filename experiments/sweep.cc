#include "experiments/sweep.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include "experiments/experiments.h"
#include "hlm/haptic_server/control/controller.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::experiments {
namespace {

using nlohmann::json;

struct Experiment {
  const char* name;
  void (*run)(Bench&);
  double cost;                ///< Of a cell on average, s.
  bool quick = true;          ///< Part of --quick.
  bool takes_values = false;  ///< Of --over.
};

constexpr Experiment kExperiments[] = {
    {"fig06", one_dof_hole_unstable, 0.01},
    {"fig09", one_dof_hole_delay, 0.04},
    {"fig14", static_contact, 0.06},
    {"fig16", tight_hole, 0.07},
    {"fig17", stiff_hole, 0.08},
    {"updates", updates, 0.06},
    {"limits", stiffness_limits, 5, true, true},
    {"observer", hand_observer, 0.5},
    {"spatial", spatial, 0.04},
    {"collisions", collisions, 0.03},
    {"linkages", linkages, 0.5},
    {"shapes", near_shapes, 0.3},
    {"ocean", ocean, 0.1, true, true},
    {"roams", roams, 0.4},
    {"bodies", bodies, 0.1},
    {"bodylimits", body_limits, 0.1, false, true},
    {"holding", holding, 0.45},
    {"held", held, 0.6},
    {"external", external, 0.06},
    {"twotools", two_tools, 0.4},
    {"scenes", scenes, 1.3},
    {"approach", approach_map, 0.03},
    {"maps", stiffness_maps, 2, false},
};

using Selection = std::vector<const Experiment*>;

Selection selected(const BenchOptions& options) {
  Selection selection;
  for (const Experiment& experiment : kExperiments) {
    const bool named = std::ranges::find(options.only, experiment.name) != options.only.end();
    const bool usual = options.only.empty() && (experiment.quick || !options.quick);
    if (named || usual) selection.push_back(&experiment);
  }
  return selection;
}

/// Runs the experiments with what `visit` gives for their cells. None of them reports.
void visit_cells(const BenchOptions& options, const Selection& selection,
                 const Bench::Visit& visit) {
  Bench bench(options, {}, visit);
  for (const Experiment* experiment : selection) {
    bench.begin(experiment->name, experiment->cost, false);
    experiment->run(bench);
    bench.close_tables();
  }
}

/// Throws std::runtime_error naming an experiment that does not take the user's values.
void check_takes_values(const BenchOptions& options) {
  std::string taking;
  for (const Experiment& experiment : kExperiments) {
    if (experiment.takes_values)
      taking += (taking.empty() ? "" : ", ") + std::string(experiment.name);
  }
  if (options.only.empty()) throw std::runtime_error("--over must go with experiments: " + taking);
  for (const Experiment* experiment : selected(options)) {
    if (!experiment->takes_values) {
      throw std::runtime_error(fmt::format(
          "experiment '{}' takes no values of --over; these do: {}", experiment->name, taking));
    }
  }
}

std::vector<Cell> cells_of(const BenchOptions& options, const Selection& selection) {
  std::vector<Cell> cells;
  visit_cells(options, selection, [&](const Cell& cell, const auto&) {
    cells.push_back(cell);
    return std::nullopt;
  });
  return cells;
}

/// Of the cells in their order, what their files say.
std::vector<std::optional<SweepFolder::Result>> results_of(const SweepFolder& folder,
                                                           const std::vector<Cell>& cells) {
  std::vector<std::optional<SweepFolder::Result>> results;
  for (const Cell& cell : cells) results.push_back(folder.read(cell));
  return results;
}

bool is_done(const std::optional<SweepFolder::Result>& result) { return result && !result->error; }

/// Those of the experiments to which cells with these names belong.
Selection concerned(Selection selection, const std::vector<std::string>& names) {
  std::set<std::string_view> experiments;
  for (const std::string& name : names) {
    experiments.insert(std::string_view(name).substr(0, name.rfind('-')));
  }
  std::erase_if(selection, [&](const Experiment* e) { return !experiments.contains(e->name); });
  return selection;
}

/// Which of the cells to run: those that are named, in any case if `again`, or all, without
/// results.
std::vector<char> chosen(const std::vector<Cell>& cells, const SweepFolder& folder,
                         const CellNames& names) {
  std::vector<char> chosen(cells.size(), names.names.empty());
  std::map<std::string_view, std::size_t> numbers;
  for (std::size_t i = 0; i < cells.size(); ++i) numbers[cells[i].name] = i;
  for (const std::string& name : names.names) {
    const auto found = numbers.find(name);
    if (found == numbers.end()) {
      throw std::runtime_error(fmt::format("cell '{}' must be one that --list-cells names", name));
    }
    chosen[found->second] = 1;
  }
  for (std::size_t i = 0; i < cells.size() && !names.again; ++i) {
    chosen[i] = chosen[i] && !is_done(folder.read(cells[i]));
  }
  return chosen;
}

std::string in_words(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  return seconds < 5400 ? fmt::format("{:.0f} min", seconds / 60)
                        : fmt::format("{:.1f} h", seconds / 3600);
}

/// Runs each of the chosen cells once, whichever thread comes to it first.
class Crew {
 public:
  Crew(const BenchOptions& options, const Selection& selection, const SweepFolder& folder,
       std::vector<char> chosen)
      : options_(options),
        selection_(selection),
        folder_(folder),
        chosen_(std::move(chosen)),
        taken_(chosen_.size()) {
    count_ = static_cast<int>(std::count(chosen_.begin(), chosen_.end(), 1));
  }

  int run(unsigned threads) {
    {
      std::vector<std::jthread> crew;
      for (unsigned i = 0; i < threads; ++i) crew.emplace_back([this] { work(); });
    }
    if (isatty(STDERR_FILENO)) fmt::print(stderr, "\r\x1b[K");
    if (failure_) std::rethrow_exception(failure_);
    return failed_;
  }

 private:
  void work() {
    try {
      std::size_t number = 0;
      visit_cells(options_, selection_,
                  [&](const Cell& cell, const std::function<json()>& compute) {
                    const std::size_t i = number++;
                    if (chosen_.at(i) && !stopped_ && !taken_[i].exchange(true))
                      run_one(cell, compute);
                    return std::nullopt;
                  });
    } catch (...) {  // A file that cannot be written.
      stopped_ = true;
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
  }

  void run_one(const Cell& cell, const std::function<json()>& compute) {
    SweepFolder::Result result;
    const auto began = std::chrono::steady_clock::now();
    try {
      result.value = compute();
    } catch (const std::exception& error) {
      result.error = error.what();
    }
    result.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    folder_.write(cell, result);
    const std::lock_guard lock(mutex_);
    if (result.error) {
      ++failed_;
      fmt::print(stderr, "{}{} ({}) failed: {}\n", isatty(STDERR_FILENO) ? "\r\x1b[K" : "",
                 cell.name, cell.condition(), *result.error);
    }
    show_progress();
  }

  /// On a terminal, one line that is rewritten.
  void show_progress() {
    ++done_;
    if (!isatty(STDERR_FILENO)) return;
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began_;
    std::string left;
    if (passed.count() > 3) {  // The first few say little about the rest.
      left = ", about " + in_words(passed.count() * (count_ - done_) / done_) + " left";
    }
    fmt::print(stderr, "\r\x1b[K{} of {} cells{}{}", done_, count_,
               failed_ > 0 ? fmt::format(", {} failed", failed_) : "", left);
    std::fflush(stderr);
  }

  const BenchOptions& options_;
  const Selection& selection_;
  const SweepFolder& folder_;
  const std::vector<char> chosen_;
  std::vector<std::atomic<bool>> taken_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::atomic<bool> stopped_ = false;
  std::mutex mutex_;
  std::exception_ptr failure_;
  int count_ = 0;
  int done_ = 0;
  int failed_ = 0;
};

void write_claims(Bench& bench) {
  Table& claims = bench.table("claims", "experiment,what,paper,criterion,measured,holds");
  for (const Claim& c : bench.claims()) {
    claims.row(c.experiment, c.what, c.paper, c.criterion, c.measured, c.holds ? 1.0 : 0.0);
  }
  Table& findings = bench.table("findings", "experiment,text");
  for (const Finding& f : bench.findings()) findings.row(f.experiment, f.text);
}

std::string arguments(const BenchOptions& options, int seeds) {
  std::string text = fmt::format("--seed {}", options.seed);
  if (options.over.empty() || options.seeds > 0) text += fmt::format(" --seeds {}", seeds);
  for (const std::string& name : options.methods) text.append(" --method ").append(name);
  if (options.quick) text.append(" --quick");
  for (const std::string& values : options.over) text.append(" --over ").append(values);
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
  if (bench.over().any()) return;  // What stands here may be what they change.
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

/// What has no results, in a table and, the first few, on stderr. Returns the experiments that lack
/// them.
std::set<std::string> name_missing(Bench& bench, const SweepFolder& folder,
                                   const std::vector<Cell>& cells,
                                   const std::vector<std::optional<SweepFolder::Result>>& results) {
  constexpr int kShown = 5;
  const bool packed = std::filesystem::exists(folder.path() / "program/experiments");
  const std::string program =
      packed ? "program/experiments" : std::filesystem::read_symlink("/proc/self/exe").string();
  std::set<std::string> incomplete;
  Table& table = bench.table("missing", "cell,method,condition,seed,why,command");
  int count = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (is_done(results[i])) continue;
    const Cell& cell = cells[i];
    const std::string why = results[i] ? *results[i]->error : "has not run";
    const std::string command = program + " --out . --cell " + cell.name;
    table.row(cell.name, text_of(cell.inputs, "method"), cell.condition(),
              text_of(cell.inputs, "seed"), why, command);
    incomplete.insert(cell.experiment);
    if (++count <= kShown) {
      fmt::print(stderr, "{} ({}): {}; in {} it runs alone with {}\n", cell.name, cell.condition(),
                 why, folder.path().string(), command);
    }
  }
  if (count > kShown) fmt::print(stderr, "… and {} more cells\n", count - kShown);
  return incomplete;
}

}  // namespace

void check_names(const BenchOptions& options) {
  if (!options.over.empty()) check_takes_values(options);
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

void check_cells(const BenchOptions& options) { cells_of(options, selected(options)); }

void list_cells(const BenchOptions& options, const SweepFolder* folder) {
  for (const Cell& cell : cells_of(options, selected(options))) {
    std::string state;
    if (folder) {
      const auto result = folder->read(cell);
      state = !result ? "\tleft" : result->error ? "\tfailed" : "\tdone";
    }
    fmt::print("{}\t{}\t{}\t{}\t{}\t{:g}{}\n", cell.name, cell.experiment,
               text_of(cell.inputs, "method"), cell.condition(), text_of(cell.inputs, "seed"),
               cell.cost, state);
  }
}

int run_cells(const BenchOptions& options, const SweepFolder& folder, const CellNames& names,
              unsigned threads) {
  Selection selection = selected(options);
  if (!names.names.empty()) selection = concerned(selection, names.names);
  return Crew(options, selection, folder, chosen(cells_of(options, selection), folder, names))
      .run(threads);
}

int show_status(const BenchOptions& options, const SweepFolder& folder) {
  int done = 0;
  int failed = 0;
  int left = 0;
  double took = 0;      // s, those that are done
  double expected = 0;  // s, the same
  double rest = 0;      // s, expected
  for (const Cell& cell : cells_of(options, selected(options))) {
    const auto result = folder.read(cell);
    done += is_done(result);
    failed += result && result->error;
    left += !result;
    if (is_done(result)) {
      took += result->seconds;
      expected += cell.cost;
    }
    if (!result) rest += cell.cost;
  }
  if (expected > 0) rest *= took / expected;
  fmt::print("{} done, {} failed, {} left{}\n", done, failed, left,
             left > 0 ? ": about " + in_words(rest) + " of one core" : "");
  return failed + left;
}

Merged merge(const BenchOptions& options, const SweepFolder& folder) {
  const Selection selection = selected(options);
  const std::vector<Cell> cells = cells_of(options, selection);
  const auto results = results_of(folder, cells);
  std::size_t number = 0;
  Bench bench(options, folder.path(),
              [&](const Cell&, const std::function<json()>&) -> std::optional<json> {
                const auto& result = results.at(number++);
                return is_done(result) ? std::optional(result->value) : std::nullopt;
              });
  folder.remove_tables();
  bench.begin("all", 0, true);
  const std::set<std::string> incomplete = name_missing(bench, folder, cells, results);
  bench.close_tables();
  for (const Experiment* experiment : selection) {
    const bool reports = !incomplete.contains(experiment->name) || bench.over().any();
    bench.begin(experiment->name, experiment->cost, reports);
    experiment->run(bench);
    bench.close_tables();
  }
  if (number != cells.size())
    throw std::logic_error("experiments asked for other cells than listed");
  bench.begin("all", 0, true);
  write_parameters(bench, options);
  write_claims(bench);
  bench.close_tables();
  const auto count = bench.claims().size();
  const auto failed = std::count_if(bench.claims().begin(), bench.claims().end(),
                                    [](const Claim& claim) { return !claim.holds; });
  if (count > 0) {
    fmt::print("{} of {} criteria hold\n", count - static_cast<std::size_t>(failed), count);
  }
  return {static_cast<int>(failed),
          static_cast<int>(std::count_if(results.begin(), results.end(),
                                         [](const auto& result) { return !is_done(result); }))};
}

}  // namespace hlm::experiments
