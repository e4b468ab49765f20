// What a device says of its handle that cannot be.
#include "hlm/device/motion_check.h"

#include <limits>
#include <string>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kDt = 1e-3;  // s.

/// How many of 100 ticks pass until something is wrong, and what; each with p further by `step`, m.
struct Verdict {
  int ticks = 0;
  std::string cause;
};
Verdict verdict(double speed, double step, bool is_old = false) {
  MotionCheck check(kDt);
  check.begin();
  Twist V = Twist::Zero();
  V[1] = speed;
  Vector3 p(0.1, 0, 0);
  for (int i = 0; i < 100; ++i) {
    p.y() += step;
    const char* const error = check.find_error(p, Matrix3::Identity(), V, is_old);
    if (error != nullptr) return {i, error};
  }
  return {100, ""};
}

TEST_CASE("A pose that stays for 15 ms while it reports a speed is frozen, one at rest is not") {
  const Verdict frozen = verdict(0.1, 0);
  CHECK(frozen.ticks == Approx(15).margin(1));
  CHECK(frozen.cause == "its pose stays the same while it says that it moves");
  CHECK(verdict(0.004, 0).ticks == 100);  // m/s: noise of a velocity at rest
  CHECK(verdict(0.1, 1e-4).ticks == 100);
}

TEST_CASE("Values that the device itself calls old are a failure after 15 ms") {
  const Verdict old = verdict(0.1, 1e-4, true);
  CHECK(old.ticks == Approx(15).margin(1));
  CHECK(old.cause.starts_with("its library holds back new values"));
}

TEST_CASE("What is no number, no rotation or a mirror is named at once") {
  const auto error_of = [](const Vector3& p, const Matrix3& R) {
    const char* const error = MotionCheck(kDt).find_error(p, R, Twist::Zero(), false);
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
