#include "tests/experiments/bench.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <numeric>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

namespace hlm::experiments {

Table::Table(const std::filesystem::path& file, std::string_view header)
    : name_(file.string()), file_(file) {
  write(std::string(header));
}

void Table::write(const std::string& line) {
  if (!(file_ << line << '\n')) throw std::runtime_error(name_ + ": cannot be written");
}

void Table::close() {
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

Bench::Bench(const BenchOptions& options) : options_(options) {
  if (options_.jobs == 0) options_.jobs = std::max(1u, std::thread::hardware_concurrency());
  if (options_.seeds == 0) options_.seeds = options_.quick ? 5 : 20;
  std::filesystem::create_directories(options_.out);
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

std::vector<Job> Bench::jobs(const std::vector<std::string>& names, int count) const {
  std::vector<Job> jobs;
  for (const Method& method : methods(names)) {
    for (const std::uint64_t seed : seed_list(count)) jobs.push_back({method, seed});
  }
  return jobs;
}

void Bench::begin(const std::string& experiment, std::size_t number, std::size_t count) {
  experiment_ = experiment;
  place_ = fmt::format("{} of {}", number, count);
  if (!isatty(STDERR_FILENO)) fmt::print(stderr, "Experiment {}: {}\n", place_, experiment_);
}

Table& Bench::table(const std::string& name, std::string_view header) {
  return tables_.emplace_back(options_.out / (name + ".csv"), header);
}

void Bench::close_tables() {
  for (Table& table : tables_) table.close();
  tables_.clear();
}

void Bench::claim(Claim claim) {
  claim.experiment = experiment_;
  fmt::print("{} {:<14} {}: {} [{}]\n", claim.holds ? "holds " : "FAILS ", claim.experiment,
             claim.what, claim.measured, claim.criterion);
  claims_.push_back(std::move(claim));
}

void Bench::find(const std::string& text) { findings_.push_back({experiment_, text}); }

void Bench::parallel(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next = 0;
  std::atomic<std::size_t> done = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto began = std::chrono::steady_clock::now();
  const auto worker = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        failure = std::current_exception();
        return;
      }
      const std::lock_guard lock(mutex);
      const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began;
      show_progress(++done, count, passed.count());
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < options_.jobs; ++i) threads.emplace_back(worker);
  threads.clear();
  if (failure) std::rethrow_exception(failure);
}

void Bench::show_progress(std::size_t done, std::size_t count, double passed) const {
  if (!isatty(STDERR_FILENO)) return;
  std::string left;
  if (passed > 3) {  // The first few say little about the rest.
    const double rest = passed * static_cast<double>(count - done) / static_cast<double>(done);
    left = rest < 90 ? fmt::format(", about {:.0f} s left", rest)
                     : fmt::format(", about {:.0f} min left", rest / 60);
  }
  fmt::print(stderr, "\r\x1b[KExperiment {}, {}: {} of {} runs done{}", place_, experiment_, done,
             count, left);
  if (done == count) fmt::print(stderr, "\r\x1b[K");
  std::fflush(stderr);
}

std::string spread(const std::vector<double>& values, double scale) {
  if (values.empty()) return "none";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return fmt::format("{:.3g} ({:.3g} to {:.3g})", scale * median(values), scale * *low,
                     scale * *high);
}

}  // namespace hlm::experiments
