#include "hlm/client/acceleration_trend.h"

#include <cmath>

#include "tests/support/catch.h"

namespace hlm {
namespace {

MovableBodies accelerating(double a) {
  MovableBodies bodies(1);
  bodies[0].id = 7;
  bodies[0].A_W[0] = a;
  return bodies;
}

TEST_CASE("The rate of a body that swings is told within a fifth of its largest") {
  constexpr double kOmega = 5;         // rad/s
  constexpr double kFrame = 1 / 60.0;  // s
  AccelerationTrend trend;
  for (int i = 0; i < 200; ++i) {
    const double time = i * kFrame;
    const AccelerationRates rates = trend.rates(accelerating(std::sin(kOmega * time)), time);
    const double told = rates.empty() ? 0 : rates[0].A_rate_W[0];
    if (i > 1) CHECK(told == Approx(kOmega * std::cos(kOmega * time)).margin(0.2 * kOmega));
  }
}

TEST_CASE(
    "A step of the acceleration is no trend, nor is one that trembles, nor a body that is new") {
  AccelerationTrend trend;
  CHECK(trend.rates(accelerating(0), 0).empty());
  CHECK(trend.rates(accelerating(0), 1).empty());
  CHECK(trend.rates(accelerating(10), 2).empty());  // A motor is switched on.
  CHECK(trend.rates(accelerating(10), 3).empty());
  for (int i = 4; i < 20; ++i) {
    CHECK(trend.rates(accelerating(i % 2 == 0 ? 10 : 11), i).empty());
  }
  CHECK(trend.rates({}, 20).empty());
  CHECK(trend.rates(accelerating(5), 21).empty());
}

TEST_CASE("A rate is told no larger than the protocol takes it") {
  AccelerationTrend trend;
  for (int i = 0; i < 3; ++i) {
    const AccelerationRates rates = trend.rates(accelerating(4e5 * i), 1e-3 * i);
    if (i == 2) CHECK((rates.size() == 1 && rates[0].A_rate_W[0] == 1e8));
  }
}

}  // namespace
}  // namespace hlm
