// A sweep: the cells of the experiments that were asked for, run by any number of programs that see
// its folder, and what is made of them.
#pragma once

#include <string>
#include <vector>

#include "experiments/bench.h"

namespace hlm::experiments {

/// Throws std::runtime_error naming what is unknown.
void check_names(const BenchOptions& options);

/// Throws std::runtime_error naming what the experiments cannot use.
void check_cells(const BenchOptions& options);

/// Prints a line for each cell, with tabulators: name, experiment, method, condition, seed,
/// expected cost in s; then, with a folder, what became of it: "done", "failed", "left".
void list_cells(const BenchOptions& options, const SweepFolder* folder);

struct CellNames {
  std::vector<std::string> names;  ///< None: all.
  bool again = false;              ///< Also those that have results.
};
/// Runs cells on so many threads. Returns how many failed, each with a word on stderr and in its
/// file. Throws naming a cell that is unknown or a file that cannot be written.
int run_cells(const BenchOptions& options, const SweepFolder& folder, const CellNames& names,
              unsigned threads);

/// How many cells are done, failed and left, and how long what is left takes a core, on stdout.
/// Returns how many are not done.
int show_status(const BenchOptions& options, const SweepFolder& folder);

struct Merged {
  int failed_claims = 0;
  int missing_cells = 0;  ///< Failed or not run: what needs them is left out.
};
/// Writes the tables, and prints the claims.
Merged merge(const BenchOptions& options, const SweepFolder& folder);

}  // namespace hlm::experiments
