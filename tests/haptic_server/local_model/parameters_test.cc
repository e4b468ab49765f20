#include "hlm/haptic_server/local_model/parameters.h"

#include <limits>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

template <class Change>
std::string error_after(Change change) {
  LocalModelParameters parameters;
  change(parameters);
  return find_error(parameters).value_or("valid");
}

TEST_CASE("A parameter out of range is named with its value and range") {
  using P = LocalModelParameters;
  CHECK(error_after([](P&) {}) == "valid");
  CHECK_THAT(error_after([](P& p) { p.stiffness = 0; }),
             ContainsSubstring("stiffness 0 N/m must be 1 to 1000000 N/m"));
  CHECK_THAT(error_after([](P& p) { p.damping = -1; }), ContainsSubstring("damping -1 N·s/m"));
  CHECK_THAT(error_after([](P& p) { p.restitution = 1.5; }),
             ContainsSubstring("restitution 1.5 must be 0 to 1"));
  CHECK_THAT(error_after([](P& p) { p.static_friction = 0.1; }),
             ContainsSubstring("static friction 0.1"));
  CHECK_THAT(error_after([](P& p) { p.kinetic_friction = -0.1; }),
             ContainsSubstring("kinetic friction -0.1"));
  CHECK_THAT(error_after([](P& p) { p.release_step = 0; }), ContainsSubstring("release step 0"));
  CHECK_THAT(
      error_after([](P& p) { p.max_hand_stiffness = std::numeric_limits<double>::quiet_NaN(); }),
      ContainsSubstring("max hand stiffness nan N/m must be above 0 N/m"));
}

}  // namespace
}  // namespace hlm::server
