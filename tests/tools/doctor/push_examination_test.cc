// The step that pushes, with the simulated device on a real clock and answers that a pipe holds.
#include "hlm/tools/doctor/push_examination.h"

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include <unistd.h>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/device/workspace.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kRate = 1000;   // Hz
constexpr double kMaxGap = 0.5;  // s
constexpr std::uint64_t kFewMissed = 10;

/// A planar device in `frame`, and what pushes of 1 N find of it.
struct Examined {
  Examined(const SimulatedDeviceOptions& options, const std::string& frame,
           const std::string& answers) {
    std::array<int, 2> ends{};
    REQUIRE(pipe(ends.data()) == 0);
    REQUIRE(write(ends[1], answers.data(), answers.size()) == static_cast<ssize_t>(answers.size()));
    WorkspaceDevice device(std::make_unique<SimulatedDevice>(options, HandScript{}, 1 / kRate),
                           {.frame = frame});
    Person person(ends[0]);
    {
      DeviceBench bench(device, kRate, kMaxGap, person);
      bench.watch(0.01);
      try {
        examine_pushes(bench, person, Outlook("right away up"), 1, 0, findings);
      } catch (const BenchEnded& ended) {
        findings.push_back({ended.verdict, "ended", ended.what(), ""});
      }
      missed = bench.missed();
      pushed = std::any_of(bench.samples().begin(), bench.samples().end(),
                           [](const HandleSample& sample) { return !sample.force.isZero(0); });
    }
    for (const int end : ends) close(end);
  }

  /// The first of a subject; empty if there is none.
  std::string text_on(const std::string& subject) const {
    const auto found = std::find_if(findings.begin(), findings.end(),
                                    [&](const Finding& f) { return f.subject == subject; });
    return found == findings.end() ? "" : std::string(name_of(found->verdict)) + ": " + found->text;
  }

  std::vector<Finding> findings;
  bool pushed = false;       ///< In the last run.
  std::uint64_t missed = 0;  ///< Ticks.
};

TEST_CASE("A handle whose state stands still is pushed once, and is a problem") {
  const Examined examined({.dry_friction = 2}, "x y z", "yes\nyes\nright\naway\n");
  REQUIRE(examined.findings.size() == 1);
  CHECK_THAT(examined.text_on("ended"),
             ContainsSubstring("problem: no new state came during a push of 1 N"));
  CHECK(examined.pushed);
}

TEST_CASE("Where the handle moves along none of the world's axes nothing is pushed") {
  const Examined examined({}, "30 30 0", "yes\nyes\n");
  REQUIRE(examined.findings.size() == 1);
  CHECK_THAT(examined.text_on("force"), ContainsSubstring("along none of the world's axes"));
}

TEST_CASE("A simulated device's delay, mass and friction are found by what pushes do") {
  const auto examine = [] {
    return Examined({.mass = 0.5, .delay = 8}, "x y z", "yes\nyes\nright\naway\n");
  };
  Examined examined = examine();
  // For missed ticks the simulated device's time stands still, but not the clock.
  for (int i = 0; i < 3 && examined.missed > kFewMissed; ++i) examined = examine();
  if (examined.missed > kFewMissed) {
    WARN("the machine is too busy for figures: " << examined.missed << " ticks were missed");
    return;
  }
  const auto number = [&](const std::string& subject) {
    const std::string text = examined.text_on(subject);
    INFO(subject << ": " << text);
    REQUIRE(!text.empty());
    return std::stod(text.substr(text.find(": ") + 2));
  };
  CHECK(number("mass") == Approx(0.5).epsilon(0.1));      // kg
  CHECK(number("friction") == Approx(0.2).margin(0.04));  // N
  CHECK(number("delay") == Approx(8).margin(2));          // ms
}

}  // namespace
}  // namespace hlm::server
