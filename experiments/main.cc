// experiments: runs the paper's experiments in virtual time and writes their tables and claims.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <thread>

#include <CLI/CLI.hpp>
#include <spdlog/fmt/fmt.h>

#include "experiments/sweep.h"

namespace hlm::experiments {
namespace {

struct Options {
  BenchOptions bench;
  std::string out = "out/reproduce";
  unsigned jobs = 0;  ///< Threads; 0: as many as cores.
  bool list = false;
  bool merge = false;
  bool status = false;
  bool replace = false;
  bool begin = false;
  std::vector<std::string> cells;
  std::string cells_file;
};

/// What chooses the cells of a sweep.
void add_selection(CLI::App& app, BenchOptions& bench) {
  app.add_flag("--quick", bench.quick, "Fewer seeds and cases");
  app.add_option("--only", bench.only, "Only these experiments");
  app.add_option("--method", bench.methods,
                 "Only these methods; claims across methods are left out");
  app.add_option("--seed", bench.seed, "First seed")
      ->check(CLI::Range(1.0, 9e15))  // What a double holds.
      ->capture_default_str();
  app.add_option("--seeds", bench.seeds, "Number of seeds, one run each; 0: 20, with --quick 5")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  app.add_option("--over", bench.over,
                 "NAME=VALUES: values of your own for a condition, with each of the others'; of "
                 "limits, bodylimits and ocean")
      ->allow_extra_args(false);
}

std::vector<std::string> selection(const BenchOptions& bench) {
  std::vector<std::string> arguments{"--seed", std::to_string(bench.seed), "--seeds",
                                     std::to_string(bench.seeds)};
  if (bench.quick) arguments.emplace_back("--quick");
  for (const std::string& name : bench.only) arguments.insert(arguments.end(), {"--only", name});
  for (const std::string& name : bench.methods) {
    arguments.insert(arguments.end(), {"--method", name});
  }
  for (const std::string& text : bench.over) arguments.insert(arguments.end(), {"--over", text});
  return arguments;
}

BenchOptions parsed(std::vector<std::string> arguments) {
  BenchOptions bench;
  CLI::App app;
  add_selection(app, bench);
  std::reverse(arguments.begin(), arguments.end());
  app.parse(arguments);
  return bench;
}

/// Those of --cell, which run again, or one a line those of the file of --cells.
CellNames names_of(const Options& options) {
  CellNames names{options.cells, !options.cells.empty()};
  if (options.cells_file.empty()) return names;
  std::ifstream file(options.cells_file);
  if (!file) throw std::runtime_error(options.cells_file + " cannot be read");
  for (std::string name; file >> name;) names.names.push_back(name);
  if (names.names.empty()) throw std::runtime_error(options.cells_file + " must name cells");
  return names;
}

/// With a copy of the files that the user's values name.
void begin(Options& options, SweepFolder& folder) {
  check_cells(options.bench);
  const Over over(options.bench.over);
  options.bench.over = over.texts();
  options.bench.files = folder.inputs();
  folder.begin(selection(options.bench), over.files(), options.replace);
}

int work_on(Options options) {
  check_names(options.bench);
  const bool some = !options.cells.empty() || !options.cells_file.empty();
  if (options.list && !options.status) {
    list_cells(options.bench, nullptr);
    return 0;
  }
  SweepFolder folder(options.out);
  if (some || options.merge || options.status) {
    options.bench = parsed(folder.open());
    options.bench.files = folder.inputs();
  } else {
    begin(options, folder);
    if (options.begin) return 0;
  }
  if (options.status && options.list) {
    list_cells(options.bench, &folder);
    return 0;
  }
  if (options.status) return show_status(options.bench, folder) > 0 ? 3 : 0;
  if (!options.merge) {
    if (options.jobs == 0) options.jobs = std::max(1u, std::thread::hardware_concurrency());
    const int failed = run_cells(options.bench, folder, names_of(options), options.jobs);
    if (some) return failed > 0 ? 3 : 0;
  }
  const Merged merged = merge(options.bench, folder);
  return merged.missing_cells > 0 ? 3 : merged.failed_claims > 0 ? 1 : 0;
}

/// How it is worked on.
void add_actions(CLI::App& app, Options& options) {
  app.add_option(
         "--out", options.out,
         "Folder of the sweep: a file for each cell, and the tables. What has run already is "
         "not run again")
      ->capture_default_str();
  app.add_flag("--replace", options.replace,
               "A sweep in the folder that is another one is removed");
  app.add_option("--jobs", options.jobs, "Threads; 0: as many as cores")
      ->check(CLI::Range(0.0, 1024.0))
      ->capture_default_str();
  app.add_flag("--list-cells", options.list,
               "Prints the cells: name, experiment, method, condition, seed, expected cost in s; "
               "with --status also done, failed or left");
  app.add_option("--cell", options.cells,
                 "Runs these cells of the sweep that the folder has, also again");
  app.add_option("--cells", options.cells_file,
                 "Those that a file names, one a line, if they have no results");
  app.add_flag("--begin", options.begin, "Begins a sweep, and runs none of its cells");
  app.add_flag("--merge", options.merge, "Only makes the tables of what has run");
  app.add_flag("--status", options.status, "Says what is done, failed and left");
}

/// What the folder says cannot be said again, and only one thing is done at a time.
void refuse_idle_options(const CLI::App& app) {
  const char* action = nullptr;
  for (const char* name : {"--cell", "--cells", "--merge", "--status", "--begin"}) {
    if (app.count(name) == 0) continue;
    if (action) throw std::runtime_error(fmt::format("{} cannot go with {}", name, action));
    action = name;
  }
  if (!action || std::string_view(action) == "--begin") return;
  for (const char* name :
       {"--quick", "--only", "--method", "--seed", "--seeds", "--over", "--replace"}) {
    if (app.count(name) == 0) continue;
    throw std::runtime_error(
        fmt::format("{} cannot go with {}, which takes what the folder has", name, action));
  }
}

int run_program(int argc, char** argv) {
  Options options;
  CLI::App app{
      "The paper's experiments, in virtual time. Status 1: a criterion fails, 2: something "
      "cannot be used, 3: cells failed or are missing."};
  add_selection(app, options.bench);
  add_actions(app, options);
  try {
    app.parse(argc, argv);
    refuse_idle_options(app);
    return work_on(options);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "experiments: " << error.what() << '\n';
    return 2;
  } catch (const std::filesystem::filesystem_error& error) {
    std::cerr << "experiments: " << error.path1().string() << ": " << error.code().message()
              << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "experiments: " << error.what() << '\n';
    return 2;
  }
}

}  // namespace
}  // namespace hlm::experiments

int main(int argc, char** argv) { return hlm::experiments::run_program(argc, argv); }
