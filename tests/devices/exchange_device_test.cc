// What the servo sees of a device behind a line, and the line of the servo.
#include "hlm/devices/exchange_device.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using std::chrono::steady_clock;

/// A line whose handle goes round at 0.5 m/s, which counts what it is asked.
struct Line {
  std::atomic<bool> is_there = true;
  std::atomic<bool> answers = true;
  std::atomic<bool> freezes = false;
  std::atomic<bool> is_finite = true;
  std::atomic<double> offset = 0;  ///< Of its position, m, to either side in turn.
  std::atomic<double> turned = 0;  ///< Its orientation, rad, to either side in turn.
  MotionCheck::SpeedSource speed_source = MotionCheck::SpeedSource::kDevice;
  std::atomic<double> force = 0;     ///< Of the latest request.
  std::atomic<bool> polled = false;  ///< Whether it asked for the state alone.
  std::atomic<bool> saturates = false;
  std::atomic<bool> takes = true;            ///< Requests.
  std::atomic<int> zeros_at_open = 0;        ///< First requests of a line that were for zero.
  std::string refusal = "nothing is there";  ///< Where nothing is.
  std::atomic<int> opened = 0;
  std::atomic<int> most_unanswered = 0;
  std::atomic<int> halted = 0;
};

class ScriptedLine final : public DeviceLine {
 public:
  explicit ScriptedLine(Line& line) : line_(line) {}

  void open() override {
    if (!line_.is_there) throw std::runtime_error(line_.refusal);
    ++line_.opened;
    is_first_ = true;
    unanswered_ = 0;
  }
  void close() noexcept override {}
  void expect_silence() override {}
  void send(const std::optional<Vector3>& force) override {
    if (!line_.takes) throw std::runtime_error("it takes nothing");
    if (std::exchange(is_first_, false) && force && force->isZero()) ++line_.zeros_at_open;
    line_.force = force.value_or(Vector3::Zero()).x();
    line_.polled = !force;
    line_.most_unanswered = std::max<int>(line_.most_unanswered, ++unanswered_);
  }
  std::optional<HandleState> receive(SteadyTime deadline) override {
    if (!line_.is_there) throw std::runtime_error("it was unplugged");
    if (!line_.answers) {
      std::this_thread::sleep_until(deadline);
      return std::nullopt;
    }
    --unanswered_;
    const std::chrono::duration<double> time = steady_clock::now() - begin_;
    if (!line_.freezes) angle_ = 5 * time.count();
    HandleState state;
    state.X.p = 0.1 * Vector3(std::cos(angle_), std::sin(angle_), line_.is_finite ? 0 : NAN);
    side_ = -side_;
    state.X.p.y() += side_ * line_.offset;
    state.X.R = Eigen::AngleAxisd(side_ * line_.turned, Vector3::UnitZ());
    state.V.head<2>() << -0.5 * std::sin(angle_), 0.5 * std::cos(angle_);
    state.saturated = line_.saturates;
    return state;
  }
  MotionCheck::SpeedSource speed_source() const noexcept override { return line_.speed_source; }
  void halt() noexcept override { ++line_.halted; }

 private:
  Line& line_;
  bool is_first_ = true;
  int unanswered_ = 0;
  steady_clock::time_point begin_ = steady_clock::now();
  double angle_ = 0;
  int side_ = 1;
};

constexpr double kOldest = 0.05;  // s: machines of tests are busy.

struct Bench {
  explicit Bench(MotionCheck::SpeedSource source = MotionCheck::SpeedSource::kDevice) {
    line.speed_source = source;
    device.calibrate();
  }

  /// Ticks for `time` s with `force`, N, until a read fails; whether none did.
  bool tick(double time, double force) {
    const auto end = steady_clock::now() + std::chrono::duration<double>(time);
    while (steady_clock::now() < end) {
      const auto state = device.read();
      if (!state) return false;
      health = state->health;
      Wrench F = Wrench::Zero();
      F[0] = force;
      CHECK(device.write(F));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }

  Line line;
  DeviceHealth health = DeviceHealth::kGood;
  ExchangeDevice device{"device",
                        {.max_force = 2, .max_torque = 0},
                        {.oldest = kOldest},
                        std::make_unique<ScriptedLine>(line)};
};

bool within(double seconds, const std::function<bool()>& holds) {
  const auto end = steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!holds()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  return true;
}

TEST_CASE("A force reaches the line only while the device is enabled, and not above its rating") {
  Bench bench;
  CHECK(bench.tick(0.05, 1));
  CHECK(bench.line.polled);
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  CHECK(bench.line.force == 1);
  CHECK(bench.tick(0.05, 5));
  CHECK(bench.line.force == 2);
  bench.device.disable();
  CHECK(within(kOldest, [&] { return bench.line.force == 0; }));
}

TEST_CASE("A servo that stands still has no force after the oldest command's time") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  REQUIRE(bench.line.force == 1);
  CHECK(within(kOldest + 0.03, [&] { return bench.line.force == 0; }));
}

TEST_CASE("A line that does not answer is asked once more, for no force, and the read fails") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  CHECK(bench.line.most_unanswered == 1);
  bench.line.answers = false;
  CHECK_FALSE(bench.tick(1, 1));
  bench.device.disable();
  CHECK(within(0.03, [&] { return bench.line.force == 0; }));
  CHECK(bench.line.most_unanswered == 2);
  CHECK(within(0.1, [&] { return !bench.device.read() && *bench.device.cause() != '\0'; }));
}

TEST_CASE("After a failure reads fail until a person enables, and then work where the line does") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  bench.line.is_there = false;
  CHECK_FALSE(bench.tick(1, 1));
  CHECK(bench.line.force == 0);
  CHECK(bench.device.cause() == std::string("it was unplugged"));
  bench.device.enable();
  CHECK_FALSE(within(0.3, [&] { return bench.device.read().has_value(); }));
  CHECK(within(1, [&] {
    bench.device.enable();
    return !bench.device.read() && bench.device.cause() == std::string("nothing is there");
  }));
  CHECK_FALSE(within(0.3, [&] { return bench.device.read().has_value(); }));

  bench.line.is_there = true;
  REQUIRE(within(1, [&] { return bench.line.opened == 2; }));
  CHECK_FALSE(within(0.1, [&] { return bench.device.read().has_value(); }));
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  CHECK(bench.line.force == 1);
}

TEST_CASE("A force that a lost line took ends with the first request once it is open again") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  SECTION("which took the request for zero and did not answer") {
    bench.line.answers = false;
    CHECK_FALSE(bench.tick(1, 1));
    CHECK(within(0.1, [&] { return bench.line.force == 0; }));
  }
  SECTION("which took no more requests, so that it is halted") {
    bench.line.takes = false;
    CHECK_FALSE(bench.tick(1, 1));
    CHECK(within(0.1, [&] { return bench.line.halted == 1; }));
    CHECK(bench.line.force == 1);
  }
  bench.line.is_there = false;
  bench.line.takes = bench.line.answers = true;
  std::this_thread::sleep_for(std::chrono::seconds(1));  // It cannot be opened meanwhile.
  CHECK(bench.line.zeros_at_open == 0);
  bench.line.is_there = true;
  REQUIRE(within(1, [&] { return bench.line.polled.load(); }));
  CHECK(bench.line.opened == 2);
  CHECK(bench.line.zeros_at_open == 1);
  CHECK(bench.line.force == 0);
}

TEST_CASE("A state that moves and stays, jumps or is not finite is named, and force ends") {
  using Source = MotionCheck::SpeedSource;
  Bench bench(GENERATE(Source::kDevice, Source::kDriver));
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  std::string cause;
  SECTION("frozen") {
    bench.line.freezes = true;
    cause = "its state is frozen: its pose sta";  // It stays, or stands.
  }
  SECTION("not finite") {
    bench.line.is_finite = false;
    cause = "is not a number";
  }
  SECTION("jumps of 0.5 m") {
    bench.line.offset = 0.25;
    cause = "its pose ";  // It jumps; where the machine stalled it moves otherwise.
  }
  SECTION("turns of 2 rad") {
    bench.line.turned = 1;
    cause = "its orientation jumps";
  }
  CHECK_FALSE(bench.tick(1, 1));
  CHECK_THAT(bench.device.cause(), ContainsSubstring(cause));
  CHECK(bench.line.force == 0);
}

TEST_CASE("Motors at their limit are reported, and force goes on") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  bench.line.saturates = true;
  CHECK(bench.tick(0.05, 1));
  CHECK(within(1, [&] {
    CHECK(bench.tick(0.005, 1));
    return bench.health == DeviceHealth::kSaturated;
  }));
  CHECK_THAT(bench.device.cause(), ContainsSubstring("at their limit"));
  CHECK(bench.line.force == 1);
}

TEST_CASE("A halt sends no force from then on, until the device is enabled") {
  Bench bench;
  bench.device.enable();
  CHECK(bench.tick(0.05, 1));
  bench.device.halt();
  CHECK(bench.line.halted == 1);
  CHECK(bench.tick(0.05, 1));
  CHECK(bench.line.force == 0);
}

TEST_CASE("A force ends at once, however seldom the device is asked") {
  Line line;
  ExchangeDevice device("device", {}, {.rate = 0.5, .oldest = 5},
                        std::make_unique<ScriptedLine>(line));
  device.calibrate();
  device.enable();
  CHECK(device.write(Wrench::Constant(1)));
  REQUIRE(within(4, [&] { return line.force == 1; }));
  device.disable();
  CHECK(within(0.5, [&] { return line.force == 0; }));  // s, of the 2 s between two requests.
}

TEST_CASE("A force may not be older than three requests take") {
  CHECK_FALSE(find_error({.rate = 1000, .oldest = 0.003}));
  CHECK_THAT(
      find_error({.rate = 100, .oldest = 0.015}).value(),
      ContainsSubstring("oldest 0.015 s must be at least 0.03 s") && ContainsSubstring("100 Hz"));
}

TEST_CASE("A cause is one line of 203 bytes at most, cut between two characters") {
  Line line;
  line.is_there = false;
  std::string text = "a\nb ";
  for (int i = 0; i < 1000; ++i) text += "\u00b5";  // Two bytes each.
  line.refusal = text;
  ExchangeDevice device("device", {}, {}, std::make_unique<ScriptedLine>(line));
  CHECK_THROWS_WITH(device.calibrate(), "device: " + ("a b " + text.substr(4, 196)) + "...");
}

TEST_CASE("A line that cannot be opened is an error of the calibration that names it") {
  Line line;
  line.is_there = false;
  ExchangeDevice device("device", {}, {}, std::make_unique<ScriptedLine>(line));
  CHECK_THROWS_WITH(device.calibrate(), "device: nothing is there");
}

TEST_CASE("Neither reading nor writing allocates") {
  Bench bench;
  bench.device.enable();
  const test::NoMalloc no_malloc;
  for (int i = 0; i < 1000; ++i) {
    bench.device.read();
    bench.device.write(Wrench::Zero());
  }
  CHECK(no_malloc.allocations() == 0);
}

}  // namespace
}  // namespace hlm::server
