// The bounds of a push on a real clock, with the simulated device.
#include "hlm/tools/doctor/device_bench.h"

#include <algorithm>
#include <array>

#include <fcntl.h>
#include <unistd.h>

#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::server {
namespace {

constexpr double kRate = 1000;   // Hz
constexpr double kMaxGap = 0.5;  // s

/// Answers that can come, and do not.
struct SilentPerson {
  SilentPerson() { REQUIRE(pipe(ends.data()) == 0); }
  ~SilentPerson() {
    for (const int end : ends) close(end);
  }
  SilentPerson(const SilentPerson&) = delete;
  SilentPerson& operator=(const SilentPerson&) = delete;

  std::array<int, 2> ends{};
  Person person() const { return Person(ends[0]); }
};

/// A handle that nobody holds, and what a push of `force` N along x for 0.5 s does to it.
struct Pushed {
  explicit Pushed(const SimulatedDeviceOptions& options, double force) {
    SimulatedDevice device(options, {}, 1 / kRate);
    const SilentPerson silent;
    Person person = silent.person();
    DeviceBench bench(device, kRate, kMaxGap, person);
    bench.enable(1);
    const test::NoMalloc guard;
    was_seen = bench.push(force * Vector3::UnitX(), 0.5);
    allocations = guard.allocations();
    samples = bench.samples();
  }

  /// Largest of the magnitudes in all samples, or in those with force.
  double largest(Vector3 HandleSample::*member, bool with_force = false) const {
    double most = 0;
    for (const HandleSample& sample : samples) {
      if (!with_force || !sample.force.isZero(0)) most = std::max(most, (sample.*member).norm());
    }
    return most;
  }
  /// s.
  double time_of_force() const {
    const auto has_force = [](const HandleSample& sample) { return !sample.force.isZero(0); };
    return static_cast<double>(std::count_if(samples.begin(), samples.end(), has_force)) / kRate;
  }

  bool was_seen = false;  ///< By new states.
  std::size_t allocations = 0;
  std::vector<HandleSample> samples;
};

TEST_CASE("A push has the force that was allowed, not the one asked for, and allocates nothing") {
  const Pushed pushed({.mass = 20, .damping = 0, .dry_friction = 0}, 3);
  CHECK(pushed.was_seen);
  CHECK(pushed.allocations == 0);
  CHECK(pushed.largest(&HandleSample::force) == Approx(1));  // N
  CHECK(pushed.time_of_force() > 0.4);                       // s
  CHECK(pushed.time_of_force() < 0.51);
}

TEST_CASE("A push ends when the handle is faster than 0.1 m/s, within a tick") {
  const Pushed pushed({.mass = 0.2, .damping = 0, .dry_friction = 0}, 1);
  CHECK(pushed.was_seen);
  // 5 m/s² for 1 ms, and for some more where the machine pauses.
  CHECK(pushed.largest(&HandleSample::v, true) <= kFastestPush);  // m/s
  CHECK(pushed.time_of_force() < 0.025);                          // s
  CHECK(pushed.samples.back().force.isZero(0));
}

TEST_CASE("A push ends when the handle has gone 20 mm, however slowly") {
  const Pushed pushed({.mass = 0.2, .damping = 12, .dry_friction = 0}, 1);
  CHECK(pushed.was_seen);
  CHECK(pushed.largest(&HandleSample::v) < kFastestPush);          // m/s
  CHECK(pushed.largest(&HandleSample::p, true) <= kFarthestPush);  // m
  CHECK(pushed.largest(&HandleSample::p, true) > 0.015);
}

TEST_CASE("A push that no new state shows ends after 0.1 s, and is said to be blind") {
  const Pushed pushed({.dry_friction = 2}, 1);
  CHECK_FALSE(pushed.was_seen);
  CHECK(pushed.time_of_force() > 0.05);  // s
  CHECK(pushed.time_of_force() < 0.11);
}

/// One that its own motors push without a command, as with a weight that they bear wrongly.
class DrivenDevice final : public Device {
 public:
  explicit DrivenDevice(double force) : force_(force) {}

  std::string_view name() const noexcept override { return raw_.name(); }
  const DeviceRatings& ratings() const noexcept override { return raw_.ratings(); }
  bool measures_hand_wrench() const noexcept override { return false; }
  void align(const Pose& X_WH) noexcept override { raw_.align(X_WH); }
  void enable() noexcept override {
    enabled = true;
    raw_.enable();
  }
  void disable() noexcept override {
    enabled = false;
    raw_.disable();
  }
  std::optional<DeviceState> read() noexcept override { return raw_.read(); }
  bool write(const Wrench& F) noexcept override {
    Wrench driven = F;
    if (enabled) driven[0] += force_;
    return raw_.write(driven);
  }

  bool enabled = false;

 private:
  SimulatedDevice raw_{{.mass = 0.2, .damping = 10, .dry_friction = 0}, {}, 1 / kRate};
  double force_;
};

TEST_CASE("Motors that drive the handle away between pushes are turned off") {
  struct Case {
    double force;     // N
    bool free;        // It was said to be.
    double farthest;  // m
    double fastest;   // m/s
  };
  const auto run = GENERATE(Case{1, true, 0.021, 0.11}, Case{8, false, 0.1, 0.55});
  DrivenDevice device(run.force);
  const SilentPerson silent;
  Person person = silent.person();
  DeviceBench bench(device, kRate, kMaxGap, person);
  bench.enable(1);
  if (run.free) bench.let_go();
  INFO(run.force << " N");
  CHECK_THROWS_AS(bench.watch(3), BenchEnded);
  CHECK_FALSE(device.enabled);
  CHECK(bench.latest().p.norm() < run.farthest);
  CHECK(bench.latest().v.norm() < run.fastest);
}

TEST_CASE("A push ends when answers have ended, and says so") {
  SimulatedDevice device({}, {}, 1 / kRate);
  SilentPerson silent;
  Person person = silent.person();
  const bool has_unread = GENERATE(false, true);
  if (has_unread) REQUIRE(write(silent.ends[1], "right\n", 6) == 6);
  close(std::exchange(silent.ends[1], dup(silent.ends[0])));  // Nobody can write any more.
  DeviceBench bench(device, kRate, kMaxGap, person);
  bench.enable(1);
  try {
    bench.push(Vector3::UnitX(), 0.5);
    FAIL("the push went on");
  } catch (const BenchEnded& ended) {
    CHECK(ended.verdict == Verdict::kWarning);
  }
  for (const HandleSample& sample : bench.samples()) CHECK(sample.force.isZero(0));
}

TEST_CASE("A file cannot allow force, a pipe can") {
  const int file = open("/dev/null", O_RDONLY | O_CLOEXEC);
  CHECK_FALSE(Person(file).may_consent());
  close(file);
  const SilentPerson silent;
  CHECK(silent.person().may_consent());
}

TEST_CASE("Answers are lines in lower case without blanks, and the last one needs no end") {
  SilentPerson silent;
  Person person = silent.person();
  CHECK_FALSE(person.has_answered());
  const std::string text = "  Yes \r\n\nno";
  REQUIRE(write(silent.ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  for (const char* const answer : {"yes", ""}) {
    REQUIRE(person.has_answered());
    CHECK(person.answer() == answer);
  }
  CHECK_FALSE(person.has_answered());
  close(std::exchange(silent.ends[1], dup(silent.ends[0])));
  REQUIRE(person.has_answered());
  CHECK_FALSE(person.is_gone());
  CHECK(person.answer() == "no");
  CHECK_FALSE(person.has_answered());
  CHECK(person.is_gone());
}

}  // namespace
}  // namespace hlm::server
