// A cell: a trial, or a search over trials, that runs by itself, anywhere and in any order; and the
// folder of a sweep, which has a file for each.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "experiments/program.h"

namespace hlm::experiments {

/// What tells a cell from others of its experiment, by the names that its tables have.
struct Input {
  template <class Number>
  requires std::is_arithmetic_v<Number> Input(std::string_view n, Number v)
      : name(n), value(static_cast<double>(v)) {}
  Input(std::string_view n, std::string_view v) : name(n), value(std::string(v)) {}
  Input(std::string_view n, const char* v) : Input(n, std::string_view(v)) {}

  std::string name;
  std::variant<double, std::string> value;
};
using Inputs = std::vector<Input>;
Inputs operator+(Inputs a, const Inputs& b);
/// As people read it; empty if there is no such input.
std::string text_of(const Inputs& inputs, std::string_view name);

struct Cell {
  std::string name;  ///< "ocean-00137".
  std::string experiment;
  Inputs inputs;
  double cost = 1;  ///< Expected, s of one core.
  /// The inputs other than method and seed: "delay_s 0.02, task lift".
  std::string condition() const;
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Program, commit, compiler, flags, executable, worlds)

/// The folder of a sweep. Its functions throw std::runtime_error naming the file.
class SweepFolder {
 public:
  explicit SweepFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Goes on with the sweep that is there. Returns the arguments that choose its cells. Throws if
  /// there is none, or one of another program.
  std::vector<std::string> open();
  /// Begins a sweep, or goes on with it. One of other arguments or of another program is refused
  /// or, where `replaces`, removed.
  /// files: those that the arguments name; they are copied.
  void begin(const std::vector<std::string>& arguments,
             const std::vector<std::filesystem::path>& files, bool replaces);
  /// Where the copies are.
  std::filesystem::path inputs() const { return folder_ / "inputs"; }

  struct Result {
    nlohmann::json value{};              ///< If there is no error.
    std::optional<std::string> error{};  ///< Why the cell failed.
    double seconds = 0;
  };
  /// None if it has not run, or its file is cut. Throws if the file is of another program, of other
  /// inputs or of another sweep.
  std::optional<Result> read(const Cell& cell) const;
  /// By rename.
  void write(const Cell& cell, const Result& result) const;

  /// Those of an earlier merge.
  void remove_tables() const;

  const std::filesystem::path& path() const { return folder_; }

 private:
  [[noreturn]] void refuse_other(const std::vector<std::string>& arguments);
  void clear() const;
  std::filesystem::path file_of(const Cell& cell) const;
  Result result_in(nlohmann::json object, const Cell& cell,
                   const std::filesystem::path& path) const;

  std::filesystem::path folder_;
  std::vector<std::string> arguments_;
};

}  // namespace hlm::experiments
