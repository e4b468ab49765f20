// How much of an observed hand's work may explain energy at the port.
#include "hlm/haptic_server/safety/hand_work.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kCapacity = 0.5;  // J
constexpr double kStep = 1e-3;     // s

DeviceRatings rated() {
  DeviceRatings ratings;
  ratings.mass = 1;
  ratings.inertia = 2e-3;
  ratings.damping = 5;
  return ratings;
}

/// A handle along x, with the work of the commands on it.
struct Handle {
  Pose X_WD;
  Twist V_WD = Twist::Zero();
  double given = 0;  // J

  void move(double speed, double force) {
    V_WD[0] = speed;
    X_WD.p.x() += speed * kStep;
    given += force * speed * kStep;
  }
};

/// Of a hand that is said to do so many joules, bit by bit, while the handle stays.
double credited_at_rest(HandWork& work, double said) {
  double sum = 0;
  for (int step = 0; step < 1000; ++step) {
    work.observe({}, Twist::Zero(), 0);
    sum += work.credited(said / 1000);
  }
  return sum;
}

TEST_CASE("A hand that is said to work while the handle rests is credited one capacity, once") {
  HandWork work(rated(), kCapacity);
  CHECK(credited_at_rest(work, 10) == Approx(kCapacity));
  CHECK(credited_at_rest(work, 10) == 0);
  work.begin();
  CHECK(credited_at_rest(work, 10) == 0);  // a new session brings none
}

TEST_CASE("A hand that moves the handle against damping and motors is credited just that work") {
  HandWork work(rated(), kCapacity);
  CHECK(credited_at_rest(work, 10) == Approx(kCapacity));
  Handle handle;
  double sum = 0;
  for (int step = 0; step < 2000; ++step) {
    handle.move(0.1, -2);  // m/s, N
    work.observe(handle.X_WD, handle.V_WD, handle.given);
    sum += work.credited(1);  // J: far too much
  }
  // ½ m v², and 2 s of b v² + 2 N v.
  CHECK(sum == Approx(0.005 + 2 * (0.05 + 0.2)).epsilon(1e-3));  // J
}

TEST_CASE("An estimate that lags a shaken handle is credited no more than the handle shows") {
  HandWork work(rated(), kCapacity);
  double said = 0;
  double credit = 0;
  Handle handle;
  const double w = 2 * std::numbers::pi * 5;  // rad/s
  for (int step = 0; step < 20'000; ++step) {
    const double t = step * kStep;
    handle.move(0.3 * std::sin(w * t), 5 * 0.3 * std::sin(w * t));  // the motors bear the damping
    work.observe(handle.X_WD, handle.V_WD, handle.given);
    // The force of the mass, 0.3 rad late.
    const double bit = 0.3 * w * std::cos(w * t - 0.3) * handle.V_WD[0] * kStep;
    said += bit;
    credit += work.credited(bit);
  }
  CAPTURE(said, credit);
  CHECK(said > 5);                                     // J
  CHECK(credit < kCapacity + 0.5 * 0.3 * 0.3 + 1e-3);  // J
}

TEST_CASE("With a scale the hand's work is that at the handle") {
  DeviceRatings large = rated();
  large.scale = 4;
  large.mass = rated().mass / 4;  // in units of the world
  large.damping = rated().damping / 4;
  HandWork work(large, kCapacity);
  work.observe({}, Twist::Zero(), 0);
  CHECK(work.credited(10) == Approx(kCapacity));
  Pose X_WD;
  X_WD.p.x() = 0.4;  // 0.1 m of the handle
  Twist V_WD = Twist::Zero();
  V_WD[0] = 0.8;  // 0.2 m/s of the handle
  work.observe(X_WD, V_WD, 0);
  CHECK(work.credited(10) == Approx(0.5 * 0.2 * 0.2 + 5 * 0.2 * 0.1));  // J
}

TEST_CASE("A number that is not finite credits nothing, and a new session forgets it") {
  HandWork work(rated(), kCapacity);
  work.observe({}, Twist::Zero(), 0);
  work.observe({}, Twist::Zero(), std::numeric_limits<double>::quiet_NaN());
  CHECK_FALSE(work.credited(1) > 0);
  work.begin();
  CHECK(work.credited(1) == 0);
}

}  // namespace
}  // namespace hlm::server
