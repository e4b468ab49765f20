#include "hlm/common/range.h"

#include <cmath>

#include "hlm/common/tuning.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST_CASE("A number outside its range is named with its value, its unit and the range") {
  const Range forces{0.1, 1000, "N"};
  CHECK_FALSE(find_error("force", 0.1, forces));
  CHECK_FALSE(find_error("force", 1000, forces));
  CHECK(find_error("force", 0.05, forces) == "force 0.05 N must be 0.1 to 1000 N");
  CHECK(find_error("force", 1e9, forces) == "force 1e+09 N must be 0.1 to 1000 N");
  CHECK(find_error("force", kNan, forces) == "force nan N must be 0.1 to 1000 N");
  CHECK(find_error("share", 2, {0, 1}) == "share 2 must be 0 to 1");
}

TEST_CASE("Infinity is in a range only where it is meant") {
  const Range rated{0.01, Range::kInfinite, "N"};
  CHECK_FALSE(find_error("force", Range::kInfinite, rated));
  CHECK(find_error("force", 0, rated) == "force 0 N must be at least 0.01 N");
  CHECK(find_error("mass", Range::kInfinite, from_zero("kg")) ==
        "mass inf kg must be at least 0 kg and finite");
  CHECK_FALSE(find_error("mass", 0, from_zero("kg")));
}

TEST_CASE("An open range excludes its end") {
  CHECK(find_error("radius", 0, above_zero("m")) == "radius 0 m must be above 0 m and finite");
  CHECK_FALSE(find_error("radius", 1e-300, above_zero("m")));
  CHECK(find_error("share", 0, {0, 1, "", true}) == "share 0 must be above 0 to 1");
}

TEST_CASE("Texts of numbers are short, and read back bit for bit") {
  CHECK(shortest_text(0.6) == "0.6");
  CHECK(shortest_text(100000) == "100000");
  CHECK(shortest_text(1e12) == "1e+12");
  CHECK(shortest_text(2.5e-5) == "2.5e-05");
  CHECK(shortest_text(0) == "0");
  CHECK(shortest_text(Range::kInfinite) == "inf");
  test::Random random;
  for (int i = 0; i < 1000; ++i) {
    const double value = random.uniform(-1, 1) * std::pow(10, random.integer(-300, 300));
    CHECK(std::stod(shortest_text(value)) == value);
  }
}

TEST_CASE("A sentence holds texts and numbers, and cuts what exceeds it") {
  CHECK(Sentence("link ") + 7 + ": " + brief_text(-0.25) + " m" == "link 7: -0.25 m");
  CHECK(find_brief_error("share", 2, {0, 1}).value() == "share 2 must be 0 to 1");
  CHECK_FALSE(find_brief_error("share", 1, {0, 1}));
  const std::string long_text(Sentence::kCapacity, 'x');
  const Sentence cut = Sentence("yy") + long_text + 5;
  CHECK(cut == ("yy" + long_text).substr(0, Sentence::kCapacity));
}

TEST_CASE("Each number of the tuning has its range") {
  for (const TuningRange& range : kTuningRanges) {
    INFO(range.name);
    CHECK(range_of(range.number).most == range.most);
    Tuning tuning;
    tuning.*range.number = range.most;
    CHECK(is_in_range(tuning));
    tuning.*range.number = std::nextafter(range.most, Range::kInfinite);
    CHECK_FALSE(is_in_range(tuning));
  }
}

}  // namespace
}  // namespace hlm
