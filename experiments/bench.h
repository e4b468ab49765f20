// What an experiment is given: results of its cells, a folder for its tables, and the list of
// claims that it makes.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "experiments/cell.h"
#include "experiments/measures.h"
#include "experiments/over.h"
#include "experiments/trial.h"

namespace hlm::experiments {

struct BenchOptions {
  bool quick = false;
  std::vector<std::string> only;     ///< Experiments; empty: all.
  std::vector<std::string> methods;  ///< Methods; empty: all.
  std::uint64_t seed = 1;            ///< The first one.
  int seeds = 0;                     ///< Of planar figures; 0: 20, with `quick` 5.
  std::vector<std::string> over;     ///< NAME=VALUES, the user's own.
  std::filesystem::path files;       ///< Folder of files that they name.
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
Inputs inputs_of(const Job& job);

/// Something seen that no criterion asks for, in words.
struct Finding {
  std::string experiment;
  std::string text;
};

/// A table of numbers or words in a CSV file. Each function throws std::runtime_error naming the
/// file if it cannot be written.
class Table {
 public:
  using Cells = std::vector<std::variant<double, std::string>>;

  /// Without a file's name all is lost that is written.
  Table(const std::filesystem::path& file, std::string_view header);
  template <class... Values>
  void row(const Values&... values) {
    std::string line;
    (line.append(line.empty() ? "" : ",").append(cell(values)), ...);
    write(line);
  }
  void row(const Cells& values);
  /// The table is complete.
  void close();

 private:
  static std::string cell(double value);
  static std::string cell(std::string_view value);

  void write(const std::string& line);

  std::string name_;
  std::ofstream file_;
};

/// An experiment asks map() for what its cells give, and makes tables and claims of it. It also
/// runs with results that are all as their types begin, to list its cells or to run some of them:
/// so it asks for the same cells whatever they give, and computes nothing that takes long outside
/// of them.
class Bench {
 public:
  /// What a cell gives, of which `work` computes it; none: nothing now.
  using Visit = std::function<std::optional<nlohmann::json>(
      const Cell&, const std::function<nlohmann::json()>& work)>;
  /// out: for tables; empty: none are written, and no claims heard.
  Bench(const BenchOptions& options, std::filesystem::path out, Visit visit);

  bool quick() const { return options_.quick; }
  std::uint64_t seed() const { return options_.seed; }
  int seeds() const { return options_.seeds; }
  /// Those of the names that were asked for.
  std::vector<Method> methods(const std::vector<std::string>& names) const;
  /// Those that were asked for or, if none was, these.
  std::vector<Method> methods_or(const std::vector<std::string>& names) const;
  /// The first `count` seeds.
  std::vector<std::uint64_t> seed_list(int count) const;
  /// Each of methods(names) with each of the first `count` seeds.
  std::vector<Job> jobs(const std::vector<std::string>& names, int count) const;
  /// The user's values. Where there are any an experiment runs with them alone, and claims nothing.
  const Over& over() const { return over_; }
  /// Of each of them, one unless more were asked for.
  std::vector<std::uint64_t> seeds_of_variant() const;
  /// Whether no method was left out: claims that compare methods need them all.
  bool complete() const { return options_.methods.empty(); }

  /// cost: of a cell, expected, s. reports: its tables are written, and its claims heard.
  void begin(const std::string& experiment, double cost, bool reports);
  /// Until close_tables().
  Table& table(const std::string& name, std::string_view header);
  /// All tables are complete.
  void close_tables();
  void claim(Claim claim);
  void find(const std::string& text);
  const std::vector<Claim>& claims() const { return claims_; }
  const std::vector<Finding>& findings() const { return findings_; }

  /// What `work` gives for each item, in their order, each one a cell that inputs_of(item) tells
  /// from the others. JSON has to know the result's type.
  template <class Item, class InputsOf, class Work>
  auto map(const std::vector<Item>& items, const InputsOf& inputs_of, const Work& work) {
    using Result = decltype(work(items.front()));
    std::vector<Result> results(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
      const Cell cell = next_cell(inputs_of(items[i]));
      const auto given = visit_(cell, [&] { return nlohmann::json(work(items[i])); });
      if (given) results[i] = read<Result>(*given, cell);
    }
    return results;
  }
  /// The same of each method and seed.
  template <class Work>
  auto map(const std::vector<Job>& jobs, const Work& work) {
    return map(
        jobs, [](const Job& job) { return inputs_of(job); }, work);
  }
  /// What one cell gives.
  template <class Work>
  auto run(const Inputs& inputs, const Work& work) {
    return map(
               std::vector{0}, [&](int) { return inputs; }, [&](int) { return work(); })
        .front();
  }

 private:
  Cell next_cell(Inputs inputs);
  /// Throws std::runtime_error naming the cell if it gave something else.
  template <class Result>
  static Result read(const nlohmann::json& given, const Cell& cell) {
    try {
      return given.get<Result>();
    } catch (const nlohmann::json::exception&) {
      throw std::runtime_error(cell.name + ".json has no results of this cell; remove it");
    }
  }

  BenchOptions options_;
  Over over_;
  std::filesystem::path out_;
  Visit visit_;
  std::string experiment_;
  double cost_ = 1;
  bool reports_ = false;
  std::size_t cells_ = 0;  ///< Of the experiment, so far.
  int asked_seeds_ = 0;
  std::vector<Claim> claims_;
  std::vector<Finding> findings_;
  std::deque<Table> tables_;
};

/// Something perceived or found with the user's values.
struct Swept {
  std::string what;       ///< "weight".
  std::string unit;       ///< Of `value` and `due`.
  std::string criterion;  ///< When it is right, in words; empty: nobody asks.
  double value = 0;
  double due = std::numeric_limits<double>::quiet_NaN();
  double deviation = std::numeric_limits<double>::quiet_NaN();  ///< Standard deviation in time.
  bool right = false;
  std::string note{};  ///< "beyond": more than `value`. "below": less than can be found.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Swept, what, unit, criterion, value, due, deviation, right, note)

/// A cell with the user's values.
struct SweptCell {
  std::string_view method;
  Inputs given;
  std::uint64_t seed = 1;
  std::function<std::vector<Swept>()> work;
};
/// Runs them, and makes the table NAME_over of what has results.
void sweep_over(Bench& bench, const std::string& name, const std::vector<SweptCell>& cells);

/// A median with its range: "3.21 (2.90-4.05)", values times `scale`.
std::string spread(const std::vector<double>& values, double scale = 1);

}  // namespace hlm::experiments
