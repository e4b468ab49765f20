// Does the histogram tell the distribution of times?
#include "hlm/haptic_server/report/histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kNanosecond = 1e-9;
constexpr double kResolution = 1.0 / 32;

TEST_CASE("Quantiles are above the exact ones by at most 1/32 of the value or 1 ns") {
  test::Random random;
  std::lognormal_distribution<double> draw(std::log(20e-6), 2.0);
  Histogram histogram;
  std::vector<double> values(10000);
  for (double& value : values) {
    value = draw(random.engine());
    histogram.record(value);
  }
  std::sort(values.begin(), values.end());
  for (const double q : {0.01, 0.5, 0.99, 0.999}) {
    CAPTURE(q);
    const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(values.size())));
    const double exact = values[rank - 1];
    CHECK(histogram.quantile(q) >= exact);
    CHECK(histogram.quantile(q) <= exact * (1 + kResolution) + 1.001 * kNanosecond);
  }
  CHECK(histogram.count() == values.size());
  CHECK(histogram.max() == values.back());
  CHECK(histogram.quantile(1) == values.back());
}

TEST_CASE("Every size of value is resolved, on either side of each power of two") {
  for (int bits = 0; bits < 36; ++bits) {
    for (const double offset : {-1.0, 0.0, 1.0}) {
      const double value = kNanosecond * (std::ldexp(1.0, bits) + offset + 0.5);
      CAPTURE(value);
      Histogram histogram;
      histogram.record(value);
      histogram.record(60.0);
      CHECK(histogram.quantile(0.5) >= value);
      CHECK(histogram.quantile(0.5) <= value * (1 + kResolution) + 1.001 * kNanosecond);
    }
  }
}

TEST_CASE("A quantile never exceeds the largest value") {
  Histogram histogram;
  histogram.record(100.3e-6);
  CHECK(histogram.quantile(0.5) == 100.3e-6);
  CHECK(histogram.quantile(0.999) == 100.3e-6);
}

TEST_CASE("The rare late tick shows at p99.9 and in the maximum only") {
  Histogram histogram;
  for (int i = 0; i < 998; ++i) histogram.record(10e-6);
  histogram.record(5e-3);
  histogram.record(50e-3);
  CHECK(histogram.quantile(0.99) == Approx(10e-6).epsilon(kResolution));
  CHECK(histogram.quantile(0.999) == Approx(5e-3).epsilon(kResolution));
  CHECK(histogram.max() == 50e-3);
}

TEST_CASE("Values outside the range are counted at its ends") {
  Histogram histogram;
  CHECK(histogram.quantile(0.5) == 0);
  histogram.record(-1e-3);
  histogram.record(std::numeric_limits<double>::quiet_NaN());
  CHECK(histogram.quantile(1) == 0);
  histogram.record(3600);
  CHECK(histogram.count() == 3);
  CHECK(histogram.max() == 3600);
  CHECK(histogram.quantile(0.6) <= 2 * kNanosecond);
  CHECK(histogram.quantile(1) == Approx(68.7).epsilon(kResolution));
}

}  // namespace
}  // namespace hlm::server
