// Does every tick get from the servo thread to the file, and is a lost one counted?
#include "hlm/haptic_server/report/tick_log.h"

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <sys/resource.h>
#include <unistd.h>

#include "hlm/haptic_server/report/tick_csv.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::EndsWith;

/// A path of this process' own, removed at the end.
class TemporaryFile {
 public:
  TemporaryFile()
      : path_(std::filesystem::temp_directory_path() /
              ("tick_log_test_" + std::to_string(getpid()) + ".csv")) {}
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  std::string name() const { return path_.string(); }
  std::string text() const {
    std::ifstream file(path_);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  std::filesystem::path path_;
};

TickRecord tick(std::uint64_t step) {
  TickRecord record;
  record.step = step;
  record.time = 1e-3 * static_cast<double>(step);
  return record;
}

TEST_CASE("The file holds the header and every tick in order") {
  TemporaryFile file;
  std::string expected = tick_csv_header();
  TickLog log(file.name(), 10, {});
  for (std::uint64_t step = 0; step < 25; ++step) {
    log.record(tick(step));
    append_tick_csv(tick(step), expected);
    if (step % 5 == 4) log.drain();
  }
  log.close();
  CHECK(log.lost() == 0);
  CHECK(file.text() == expected);
}

TEST_CASE("A log without a file feeds its observer") {
  std::vector<std::uint64_t> steps;
  TickLog log("", 10, [&](const TickRecord& record) { steps.push_back(record.step); });
  log.record(tick(1));
  log.record(tick(2));
  CHECK(steps.empty());
  log.drain();
  CHECK(steps == std::vector<std::uint64_t>{1, 2});
  log.record(tick(3));
  log.close();
  CHECK(steps == std::vector<std::uint64_t>{1, 2, 3});
}

TEST_CASE("A full ring loses the newest ticks and counts them") {
  std::vector<std::uint64_t> steps;
  TickLog log("", 4, [&](const TickRecord& record) { steps.push_back(record.step); });
  for (std::uint64_t step = 0; step < 7; ++step) log.record(tick(step));
  CHECK(log.lost() == 3);
  log.drain();
  CHECK(steps == std::vector<std::uint64_t>{0, 1, 2, 3});
  log.record(tick(7));
  log.close();
  CHECK(steps.back() == 7);
}

TEST_CASE("Recording allocates nothing, with room in the ring and without") {
  TickLog log("", 4, {});
  const test::NoMalloc guard;
  for (std::uint64_t step = 0; step < 10; ++step) log.record(tick(step));
  CHECK(guard.allocations() == 0);
}

TEST_CASE("Ticks recorded while a thread drains arrive complete and in order") {
  constexpr std::uint64_t kTicks = 20000;
  TemporaryFile file;
  std::uint64_t observed = 0;
  bool ordered = true;
  TickLog log(file.name(), 64, [&](const TickRecord& record) {
    ordered = ordered && record.step > observed && record.time == 1e-3 * double(record.step);
    observed = record.step;
  });
  {
    TickLogThread writer(log);
    for (std::uint64_t step = 1; step <= kTicks; ++step) {
      log.record(tick(step));
      if (step % 32 == 0) std::this_thread::yield();
    }
  }
  log.close();
  CHECK(ordered);
  CHECK(observed > 0);
  const std::string text = file.text();
  const auto lines = static_cast<std::uint64_t>(std::count(text.begin(), text.end(), '\n'));
  CHECK(lines - 1 + log.lost() == kTicks);
}

TEST_CASE("A file that cannot be created is refused by name and reason") {
  CHECK_THROWS_WITH(TickLog("/nowhere/ticks.csv", 10, {}),
                    "tick log /nowhere/ticks.csv cannot be written: No such file or directory");
  CHECK_THROWS_WITH(TickLog("/dev/full", 10, {}),
                    "tick log /dev/full cannot be written: No space left on device");
}

/// While it lives, no file of this process grows beyond `size` bytes.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t size) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{size, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, SIG_IGN);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_DFL);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_CASE("A disk that fills up ends the file, not the observation, and is reported at once") {
  TemporaryFile file;
  FileSizeLimit limit(10000);
  int observed = 0;
  std::vector<std::string> reports;
  std::uint64_t reported_at = 0;
  TickLog log(
      file.name(), 100, [&](const TickRecord&) { ++observed; },
      [&](const std::string& reason) { reports.push_back(reason); });
  for (int i = 0; i < 20; ++i) {
    for (std::uint64_t step = 0; step < 10; ++step) log.record(tick(step));
    log.drain();
    if (reported_at == 0 && !reports.empty()) reported_at = static_cast<std::uint64_t>(observed);
  }
  CHECK(observed == 200);
  CHECK(reported_at < 100);
  REQUIRE(reports.size() == 1);
  CHECK_THAT(reports.front(), EndsWith("cannot be written: File too large"));
  CHECK_THROWS_WITH(log.close(), EndsWith("cannot be written: File too large"));
}

}  // namespace
}  // namespace hlm::server
