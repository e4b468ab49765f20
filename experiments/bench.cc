#include "experiments/bench.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

namespace hlm::experiments {

Table::Table(const std::filesystem::path& file, std::string_view header) : name_(file.string()) {
  if (name_.empty()) return;
  file_.open(file);
  write(std::string(header));
}

void Table::write(const std::string& line) {
  if (name_.empty()) return;
  if (!(file_ << line << '\n')) throw std::runtime_error(name_ + ": cannot be written");
}

void Table::row(const Cells& values) {
  std::string line;
  for (const auto& value : values) {
    line += line.empty() ? "" : ",";
    line += std::visit([](const auto& v) { return cell(v); }, value);
  }
  write(line);
}

void Table::close() {
  if (name_.empty()) return;
  file_.close();
  if (!file_) throw std::runtime_error(name_ + ": cannot be written");
}

std::string Table::cell(std::string_view value) {
  if (value.find_first_of(",\"") == value.npos) return std::string(value);
  std::string quoted = "\"";
  for (const char c : value) {
    quoted += c;
    if (c == '"') quoted += c;
  }
  return quoted + "\"";
}

std::string Table::cell(double value) { return fmt::format("{:.9g}", value); }

Inputs inputs_of(const Job& job) { return {{"method", job.method.name}, {"seed", job.seed}}; }

Bench::Bench(const BenchOptions& options, std::filesystem::path out, Visit visit)
    : options_(options),
      over_(options.over, options.files),
      out_(std::move(out)),
      visit_(std::move(visit)) {
  asked_seeds_ = options_.seeds;
  if (options_.seeds == 0) options_.seeds = options_.quick ? 5 : 20;
}

std::vector<Method> Bench::methods(const std::vector<std::string>& names) const {
  std::vector<Method> wanted;
  for (const std::string& name : names) {
    const auto& filter = options_.methods;
    const bool asked = std::find(filter.begin(), filter.end(), name) != filter.end();
    if (filter.empty() || asked) wanted.push_back(method(name));
  }
  return wanted;
}

std::vector<std::uint64_t> Bench::seed_list(int count) const {
  std::vector<std::uint64_t> seeds(static_cast<std::size_t>(count));
  std::iota(seeds.begin(), seeds.end(), options_.seed);
  return seeds;
}

std::vector<Method> Bench::methods_or(const std::vector<std::string>& names) const {
  return methods(options_.methods.empty() ? names : options_.methods);
}

std::vector<std::uint64_t> Bench::seeds_of_variant() const {
  return seed_list(std::max(1, asked_seeds_));
}

std::vector<Job> Bench::jobs(const std::vector<std::string>& names, int count) const {
  std::vector<Job> jobs;
  for (const Method& method : methods(names)) {
    for (const std::uint64_t seed : seed_list(count)) jobs.push_back({method, seed});
  }
  return jobs;
}

void Bench::begin(const std::string& experiment, double cost, bool reports) {
  experiment_ = experiment;
  cost_ = cost;
  reports_ = reports;
  cells_ = 0;
}

Cell Bench::next_cell(Inputs inputs) {
  if (text_of(inputs, "seed").empty()) inputs.emplace_back("seed", seed());
  return {fmt::format("{}-{:05}", experiment_, ++cells_), experiment_, std::move(inputs), cost_};
}

Table& Bench::table(const std::string& name, std::string_view header) {
  return tables_.emplace_back(reports_ ? out_ / (name + ".csv") : std::filesystem::path{}, header);
}

void Bench::close_tables() {
  for (Table& table : tables_) table.close();
  tables_.clear();
}

void Bench::claim(Claim claim) {
  if (!reports_) return;
  claim.experiment = experiment_;
  fmt::print("{} {:<14} {}: {} [{}]\n", claim.holds ? "holds " : "FAILS ", claim.experiment,
             claim.what, claim.measured, claim.criterion);
  claims_.push_back(std::move(claim));
}

void Bench::find(const std::string& text) {
  if (reports_) findings_.push_back({experiment_, text});
}

void sweep_over(Bench& bench, const std::string& name, const std::vector<SweptCell>& cells) {
  if (cells.empty()) {
    throw std::runtime_error(name + " has no cells with these values and methods");
  }
  const auto inputs = [](const SweptCell& cell) {
    return Inputs{{"method", cell.method}} + cell.given + Inputs{{"seed", cell.seed}};
  };
  const auto found = bench.map(cells, inputs, [](const SweptCell& cell) { return cell.work(); });
  std::string header = "what,unit,criterion,method";
  for (const Input& input : cells.front().given) header += "," + input.name;
  Table& table = bench.table(name + "_over", header + ",seed,value,due,sd,right,note");
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (const Swept& swept : found[i]) {
      Table::Cells row{swept.what, swept.unit, swept.criterion,
                       std::string(method(cells[i].method).label)};
      for (const Input& input : cells[i].given) row.push_back(input.value);
      const double right = swept.criterion.empty() ? std::numeric_limits<double>::quiet_NaN()
                                                   : static_cast<double>(swept.right);
      row.insert(row.end(), {static_cast<double>(cells[i].seed), swept.value, swept.due,
                             swept.deviation, right, swept.note});
      table.row(row);
    }
  }
}

std::string spread(const std::vector<double>& values, double scale) {
  if (values.empty()) return "none";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return fmt::format("{:.3g} ({:.3g} to {:.3g})", scale * median(values), scale * *low,
                     scale * *high);
}

}  // namespace hlm::experiments
