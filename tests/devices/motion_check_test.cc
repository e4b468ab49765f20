// What a device says of its handle that cannot be.
#include "hlm/devices/motion_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;  // s.

/// How many of 100 ticks pass until something is wrong, and what; each with p further by `step`, m.
struct Verdict {
  int ticks = 0;
  std::string cause;
};
Verdict verdict(double speed, double step, bool is_old = false) {
  MotionCheck check;
  check.begin();
  Twist V = Twist::Zero();
  V[1] = speed;
  Vector3 p(0.1, 0, 0);
  for (int i = 0; i < 100; ++i) {
    p.y() += step;
    const char* const error = check.find_error(i * kDt, p, Matrix3::Identity(), V, is_old);
    if (error != nullptr) return {i, error};
  }
  return {100, ""};
}

TEST_CASE("A pose that stays for 15 ms while it reports a speed is frozen, one at rest is not") {
  const Verdict frozen = verdict(0.1, 0);
  CHECK(frozen.ticks == Approx(15).margin(1));
  CHECK(frozen.cause == "its state is frozen: its pose stays the same while it says that it moves");
  CHECK(verdict(0.004, 0).ticks == 100);  // m/s: noise of a velocity at rest
  CHECK(verdict(0.1, 1e-4).ticks == 100);
}

TEST_CASE("Values that the device itself calls old are a failure after 15 ms") {
  const Verdict old = verdict(0.1, 1e-4, true);
  CHECK(old.ticks == Approx(15).margin(1));
  CHECK(old.cause.starts_with("its library holds back new values"));
}

/// How a vendor's side makes a speed of positions: the mean over `window`, s, or a low-pass of
/// `cutoff`, Hz; positions are whole multiples of `step`, m.
struct Estimate {
  const char* name;
  double window;
  double cutoff;
  double step;
};
constexpr Estimate kEstimates[] = {{"Force Dimension, 20 ms", 0.02, 0, 10e-6},
                                   {"Force Dimension, 5 ms", 0.005, 0, 10e-6},
                                   {"OpenHaptics, 20 Hz", 0, 20, 55e-6}};

/// What is wrong with a handle at place(t), m, along y; sampled at 1 kHz for 1 s, whose library is
/// new every `held` ticks.
std::string cause_of(const Estimate& estimate, const std::function<double(double)>& place,
                     double begin = 0, int held = 1) {
  MotionCheck check;
  check.begin(estimate.window);
  std::vector<double> y;
  double v = 0;
  double shown = 0;
  Twist V = Twist::Zero();
  for (int i = 0; i < 1000; ++i) {
    y.push_back(estimate.step * std::round(place(begin + i * kDt) / estimate.step));
    const auto back = static_cast<std::size_t>(std::lround(estimate.window / kDt));
    if (estimate.window > 0) {
      v = (y.back() - y[y.size() - 1 - std::min(back, y.size() - 1)]) / estimate.window;
    } else if (i > 0) {
      const double gain = -std::expm1(-2 * std::numbers::pi * estimate.cutoff * kDt);
      v += gain * ((y.back() - y[y.size() - 2]) / kDt - v);
    }
    if (i % held == 0) V[1] = v;
    if (i % held == 0) shown = y.back();
    const char* const error =
        check.find_error(i * kDt, {0, shown, 0}, Matrix3::Identity(), V, false);
    if (error != nullptr) return error;
  }
  return "";
}

TEST_CASE("A handle that a stop or friction holds is no fault, however its speed is estimated") {
  test::Random random;
  const auto any = [&random] { return random.uniform(0, 1); };
  for (const Estimate& estimate : kEstimates) {
    INFO(estimate.name);
    for (int i = 0; i < 200; ++i) {
      const double speed = std::pow(10, -2.5 + 2.8 * any());  // 3 mm/s to 2 m/s.
      const double end = 0.1 + 0.3 * any();                   // s.
      const int held = 1 + static_cast<int>(5 * any());
      INFO(speed << " m/s until " << end << " s, new every " << held << " ms");
      CHECK(cause_of(
                estimate, [&](double t) { return speed * std::min(t, end); }, 0, held) == "");
      // It sticks and slips by up to 1 mm, some 20 times a second.
      const double slip = 1e-3 * any();
      const double period = 0.02 + 0.06 * any();
      CHECK(cause_of(
                estimate, [&](double t) { return slip * std::floor(t / period); }, 0, held) == "");
    }
  }
}

TEST_CASE("A handle that is shaken, or hits a wall and bounces, is no fault") {
  for (const Estimate& estimate : kEstimates) {
    INFO(estimate.name);
    for (const double frequency : {1.0, 3.0, 10.0, 25.0, 50.0, 100.0}) {  // Hz.
      const double amplitude = std::min(0.1, 0.6 / (2 * std::numbers::pi * frequency));
      INFO(frequency << " Hz, " << amplitude << " m");
      CHECK(cause_of(estimate, [&](double t) {
              return amplitude * std::sin(2 * std::numbers::pi * frequency * t);
            }) == "");
    }
    CHECK(cause_of(estimate, [](double t) { return std::abs(std::fmod(1.5 * t, 0.4) - 0.2); }) ==
          "");
  }
}

TEST_CASE("A pose that jumps by 50 mm in a tick is a fault in that tick, whatever its speed says") {
  for (const Estimate& estimate : kEstimates) {
    INFO(estimate.name);
    CHECK(cause_of(estimate, [](double t) { return t < 0.5 ? 0 : 0.05; }) ==
          "its pose jumps farther than a hand can move it");
  }
  const Verdict silent = verdict(0, 0.008);  // m in each tick
  CHECK(silent.ticks == 1);
  CHECK(silent.cause == "its pose moves otherwise than its speed says");
}

TEST_CASE("A pose that goes on while its speed says something else is a fault within 50 ms") {
  const Verdict none = verdict(0, 2e-4);  // 0.2 m/s
  CHECK(none.ticks < 50);
  CHECK(none.cause == "its pose moves otherwise than its speed says");
  CHECK(verdict(-0.2, 2e-4).ticks < 50);   // The other way.
  CHECK(verdict(0.2, 2e-4).ticks == 100);  // It does.
  CHECK(verdict(200, 2e-4).ticks < 50);    // mm/s
}

TEST_CASE("An orientation that jumps by 0.6 rad in a tick is a fault, whatever its speed says") {
  const auto cause_of_turn = [](double jump, double rate) {
    MotionCheck check;
    check.begin();
    Twist V = Twist::Zero();
    V[5] = rate;
    for (int i = 0; i < 100; ++i) {
      const double angle = rate * i * kDt + (i < 50 ? 0 : jump);
      const Matrix3 R = Eigen::AngleAxisd(angle, Vector3::UnitZ()).toRotationMatrix();
      const char* const error = check.find_error(i * kDt, Vector3::Zero(), R, V, false);
      if (error != nullptr) return std::to_string(i) + ": " + error;
    }
    return std::string("none");
  };
  const std::string jumps = "50: its orientation jumps farther than a hand can turn it";
  CHECK(cause_of_turn(0.6, 0) == jumps);
  CHECK(cause_of_turn(-3, 20) == jumps);
  CHECK(cause_of_turn(0.4, 0) == "none");  // A grip that missed 20 ms at 20 rad/s.
  CHECK(cause_of_turn(0, 40) == "none");   // rad/s
}

TEST_CASE("An orientation that stays for 25 ms while it reports a speed is frozen") {
  MotionCheck check;
  check.begin();
  Twist V = Twist::Zero();
  V[5] = 1;
  int ticks = 0;
  const auto error = [&] {
    return check.find_error(ticks * kDt, Vector3::Zero(), Matrix3::Identity(), V, false);
  };
  while (ticks < 100 && error() == nullptr) ++ticks;
  CHECK(ticks == 25);
  CHECK(std::string(error()).starts_with("its state is frozen: its orientation stays the same"));
}

/// What is wrong with a handle at place(t), m, whose driver makes the speed of its steps of 0.1 mm
/// itself; asked every `period`, s, for 1 s.
Verdict verdict_on_steps(const std::function<double(double)>& place, double period) {
  MotionCheck check;
  check.begin(0, MotionCheck::SpeedSource::kDriver);
  double v = 0;
  double before = place(0);
  for (int i = 0; i * period < 1; ++i) {
    const double y = 1e-4 * std::round(place(i * period) / 1e-4);
    v += -std::expm1(-2 * std::numbers::pi * 20 * period) * ((y - before) / period - v);
    before = y;
    Twist V = Twist::Zero();
    V[1] = v;
    const char* const error =
        check.find_error(i * period, {0, y, 0}, Matrix3::Identity(), V, false, period / 2);
    if (error != nullptr) return {static_cast<int>(std::lround(i * period / kDt)), error};
  }
  return {1000, ""};
}

TEST_CASE(
    "Steps that end at 0.2 m/s and stay for 15 ms are frozen, those that a hand ends are not") {
  for (const double period : {0.5e-3, 1e-3, 2e-3}) {  // s.
    INFO(1e3 * period << " ms");
    for (const double speed : {0.2, 0.4, 1.0}) {  // m/s, until 0.5 s.
      INFO(speed << " m/s");
      const auto freezes = [speed](double t) { return speed * std::min(t, 0.5); };
      const Verdict frozen = verdict_on_steps(freezes, period);
      CHECK(frozen.ticks == Approx(516).margin(3));
      CHECK(frozen.cause.starts_with("its state is frozen: its pose stands right after it moved"));
      // A hand that brakes it with 30 m/s², and holds it.
      const auto braked = [speed](double t) {
        const double brakes = std::clamp(t - 0.5, 0.0, speed / 30);
        return speed * (std::min(t, 0.5) + brakes) - 15 * brakes * brakes;
      };
      CHECK(verdict_on_steps(braked, period).cause == "");
    }
    // Friction: it slips by 1 mm within 10 ms, some 20 times a second.
    CHECK(verdict_on_steps(
              [](double t) {
                return 1e-3 * std::floor(t / 0.05) +
                       1e-3 * std::min(std::fmod(t, 0.05) / 0.01, 1.0);
              },
              period)
              .cause == "");
    const auto jumps = [](double t) { return t < 0.5 ? 0 : 0.05; };
    CHECK(verdict_on_steps(jumps, period).cause ==
          "its pose jumps farther than a hand can move it");
  }
}

TEST_CASE(
    "Times that are not sure by 15 ms make no fault of 1 m/s, and more than 20 ms tell nothing") {
  test::Random random;
  for (const double age : {0.015, 0.1}) {  // s.
    MotionCheck check;
    check.begin();
    Twist V = Twist::Zero();
    V[1] = 1;
    double asked = 0;
    for (int i = 0; i < 1000; ++i) {
      const double doubt = i % 10 == 0 ? age : 0.5e-3;
      const double seen = asked + random.uniform(0, doubt);
      asked += doubt;
      INFO(age << " s, state " << i);
      const char* const error =
          check.find_error(asked, {0, seen, 0}, Matrix3::Identity(), V, false, doubt);
      REQUIRE(std::string(error != nullptr ? error : "") == "");
    }
  }
}

TEST_CASE("What is no number, no rotation or a mirror is named at once") {
  const auto error_of = [](const Vector3& p, const Matrix3& R) {
    const char* const error = MotionCheck().find_error(0, p, R, Twist::Zero(), false);
    return std::string(error != nullptr ? error : "none");
  };
  const Vector3 origin = Vector3::Zero();
  const Matrix3 turned = Eigen::AngleAxisd(1, Vector3(1, 2, 2).normalized()).toRotationMatrix();
  CHECK(error_of(origin, turned) == "none");
  CHECK(error_of(origin, -turned) ==
        "its orientation is that of a mirror: its frame is left-handed");
  CHECK(error_of(origin, 1.01 * turned) == "its orientation is no rotation");
  CHECK(error_of(origin, Matrix3::Zero()) == "its orientation is no rotation");
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  CHECK(error_of({0, kNan, 0}, turned) == "its pose or its speed is not a number");
}

}  // namespace
}  // namespace hlm::server
