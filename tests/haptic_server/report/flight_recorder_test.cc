// What the flight recorder writes, when, and what it keeps.
#include "hlm/haptic_server/report/flight_recorder.h"

#include <cmath>
#include <fstream>
#include <optional>

#include "hlm/common/settings/directories.h"
#include "hlm/haptic_server/report/tick_csv.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

struct Recording {
  std::string name;
  std::string header;
  std::vector<std::uint64_t> steps;
};

Recording read(const std::filesystem::path& path) {
  Recording recording;
  recording.name = path.filename();
  std::ifstream file(path);
  std::getline(file, recording.header);
  std::string line;
  while (std::getline(file, line)) {
    // Columns session, step, …
    recording.steps.push_back(std::stoull(line.substr(line.find(',') + 1)));
  }
  return recording;
}

bool is_gapless(const std::vector<std::uint64_t>& steps) {
  for (std::size_t i = 1; i < steps.size(); ++i) {
    if (steps[i] != steps[i - 1] + 1) return false;
  }
  return !steps.empty();
}

/// A recorder in a directory of its own, and the ticks of a server at `rate`.
struct Bench {
  explicit Bench(double servo_rate, int kept = 20)
      : rate(servo_rate), recorder(std::in_place, FlightRecorderOptions{directory, kept, rate}) {}

  void tick(Fault fault = Fault::kNone) {
    TickRecord record;
    record.step = ++step;
    record.time = static_cast<double>(step) / rate;
    record.fault = last_fault = fault;
    recorder->observe(record);
  }
  void ticks(double seconds, Fault fault = Fault::kNone) {
    for (double n = std::round(seconds * rate); n > 0; --n) tick(fault);
  }
  std::vector<std::filesystem::path> files() const { return settings::find_recordings(directory); }
  /// Ticks go on meanwhile.
  void await(std::size_t count) {
    REQUIRE(test::wait_until(20, [&] {
      tick(last_fault);
      return files().size() == count;
    }));
  }

  test::TemporaryDirectory temporary;
  std::filesystem::path directory = temporary.file("recordings");
  double rate;
  std::optional<FlightRecorder> recorder;
  std::uint64_t step = 0;
  Fault last_fault = Fault::kNone;
};

TEST_CASE("A fault's recording holds the 10 s before it and half a second after it") {
  Bench bench(100);
  bench.ticks(30);
  bench.ticks(0.5, Fault::kOverrun);
  CHECK(bench.files().empty());
  bench.tick(Fault::kOverrun);
  bench.await(1);
  bench.ticks(60, Fault::kOverrun);
  const Recording recording = read(bench.files().front());
  CHECK_THAT(recording.name, ContainsSubstring("-overrun.csv"));
  CHECK(recording.header + '\n' == tick_csv_header());
  CHECK(is_gapless(recording.steps));
  // The fault is in step 3001.
  CHECK(recording.steps.front() == 3001 + 50 - 1050 + 1);
  CHECK(recording.steps.back() == 3001 + 50);
  CHECK(bench.files().size() == 1);
}

TEST_CASE("A server younger than 10 s has all its ticks recorded") {
  Bench bench(100);
  bench.ticks(2);
  bench.recorder->request();
  bench.ticks(0.6);
  bench.await(1);
  const Recording recording = read(bench.files().front());
  CHECK_THAT(recording.name, ContainsSubstring("-request.csv"));
  CHECK(recording.steps.front() == 1);
  CHECK(is_gapless(recording.steps));
}

TEST_CASE("What is due when the server ends is written") {
  Bench bench(100);
  bench.ticks(1);
  bench.tick(Fault::kDevice);
  bench.recorder.reset();
  REQUIRE(bench.files().size() == 1);
  CHECK(read(bench.files().front()).steps.back() == 101);
}

TEST_CASE("Ticks that come while a recording is written are in the next one") {
  Bench bench(8000);
  bench.ticks(12);
  bench.recorder->request();
  bench.ticks(0.51);
  bench.recorder->request();  // The writer has just begun.
  bench.ticks(3);
  bench.await(2);
  CHECK(bench.recorder->lost() == 0);
  for (const auto& file : bench.files()) {
    const Recording recording = read(file);
    CHECK(recording.steps.size() == 84'000);
    CHECK(is_gapless(recording.steps));
  }
}

TEST_CASE("A recording stays whole however many ticks come while it is written") {
  Bench bench(8000);
  bench.ticks(12);
  bench.recorder->request();
  bench.ticks(0.51);
  bench.ticks(60);
  bench.await(1);
  const Recording recording = read(bench.files().front());
  CHECK(is_gapless(recording.steps));
  CHECK(recording.steps.size() == 84'000);
}

TEST_CASE("The newest recordings stay, and nothing else in the directory is touched") {
  Bench bench(100, 2);
  std::filesystem::create_directories(bench.directory);
  std::ofstream(bench.directory / "notes.txt") << "mine";
  std::string last;
  for (int i = 0; i < 4; ++i) {
    bench.ticks(1);
    bench.recorder->request();
    bench.ticks(0.6);
    CHECK(test::wait_until(10, [&] {
      bench.tick();  // A recorder that is still busy takes the request at a later one.
      const auto files = bench.files();
      return !files.empty() && files.back() != last && files.size() <= 2;
    }));
    last = bench.files().back();
  }
  CHECK(bench.files().size() == 2);
  CHECK(bench.files().back() == last);
  CHECK(std::filesystem::exists(bench.directory / "notes.txt"));
}

}  // namespace
}  // namespace hlm::server
