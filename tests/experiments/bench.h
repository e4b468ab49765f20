// What an experiment is given: cores to run trials on, a folder for its tables, and the list of
// claims that it makes.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/experiments/measures.h"
#include "tests/experiments/trial.h"

namespace hlm::experiments {

struct BenchOptions {
  bool quick = false;
  std::vector<std::string> only;     ///< Experiments; empty: all.
  std::vector<std::string> methods;  ///< Methods; empty: all.
  std::uint64_t seed = 1;            ///< The first one.
  int seeds = 0;                     ///< Of planar figures; 0: 20, with `quick` 5.
  unsigned jobs = 0;                 ///< Threads; 0: as many as cores.
  std::filesystem::path out = "out/reproduce";
};

/// A criterion, and whether it holds.
struct Claim {
  std::string experiment{};
  std::string what{};       ///< Of which figure, method.
  std::string paper{};      ///< What the paper reports; may be empty.
  std::string criterion{};  ///< With its numbers.
  std::string measured{};
  bool holds = false;
};

/// One run of a figure.
struct Job {
  Method method;
  std::uint64_t seed = 1;
};

/// Something seen that no criterion asks for, in words.
struct Finding {
  std::string experiment;
  std::string text;
};

/// A table of numbers or words in a CSV file. Each function throws std::runtime_error naming the
/// file if it cannot be written.
class Table {
 public:
  Table(const std::filesystem::path& file, std::string_view header);
  template <class... Values>
  void row(const Values&... values) {
    std::string line;
    (line.append(line.empty() ? "" : ",").append(cell(values)), ...);
    write(line);
  }
  /// The table is complete.
  void close();

 private:
  static std::string cell(double value);
  static std::string cell(std::string_view value);

  void write(const std::string& line);

  std::string name_;
  std::ofstream file_;
};

class Bench {
 public:
  explicit Bench(const BenchOptions& options);

  bool quick() const { return options_.quick; }
  std::uint64_t seed() const { return options_.seed; }
  int seeds() const { return options_.seeds; }
  /// Those of the names that were asked for.
  std::vector<Method> methods(const std::vector<std::string>& names) const;
  /// The first `count` seeds.
  std::vector<std::uint64_t> seed_list(int count) const;
  /// Each of methods(names) with each of the first `count` seeds.
  std::vector<Job> jobs(const std::vector<std::string>& names, int count) const;
  /// Whether no method was left out: claims that compare methods need them all.
  bool complete() const { return options_.methods.empty(); }

  /// The first one is number 1.
  void begin(const std::string& experiment, std::size_t number, std::size_t count);
  /// Until close_tables().
  Table& table(const std::string& name, std::string_view header);
  /// All tables are complete.
  void close_tables();
  void claim(Claim claim);
  void find(const std::string& text);
  const std::vector<Claim>& claims() const { return claims_; }
  const std::vector<Finding>& findings() const { return findings_; }

  /// What `work` gives for each item, on all cores, in the order of the items.
  template <class Item, class Work>
  auto map(const std::vector<Item>& items, const Work& work) {
    using Result = decltype(work(items.front()));
    std::vector<Result> results(items.size());
    parallel(items.size(), [&](std::size_t i) { results[i] = work(items[i]); });
    return results;
  }

 private:
  void parallel(std::size_t count, const std::function<void(std::size_t)>& work);
  /// On a terminal, one line that is rewritten. passed: since the runs began, s.
  void show_progress(std::size_t done, std::size_t count, double passed) const;

  BenchOptions options_;
  std::string experiment_;
  std::string place_;  ///< "3 of 19": which experiment it is.
  std::vector<Claim> claims_;
  std::vector<Finding> findings_;
  std::deque<Table> tables_;
};

/// A median with its range: "3.21 (2.90-4.05)", values times `scale`.
std::string spread(const std::vector<double>& values, double scale = 1);

}  // namespace hlm::experiments
