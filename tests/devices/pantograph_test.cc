// The 2DIY's kinematics and frames.
#include "hlm/devices/pantograph.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "hlm/devices/diy_frames.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// A place in the middle of the workspace of the kit, m.
Vector2 place(test::Random& random) {
  return {random.uniform(-0.03, 0.07), random.uniform(0.04, 0.12)};
}

TEST_CASE("Angles of a place lead back to it within 1e-12 m") {
  test::Random random;
  const Pantograph arms;
  for (int i = 0; i < 1000; ++i) {
    const Vector2 p = place(random);
    const auto theta = arms.angles(p);
    REQUIRE(theta);
    const auto handle = arms.handle(*theta);
    REQUIRE(handle);
    REQUIRE((handle->p - p).norm() < 1e-12);
  }
}

TEST_CASE("The Jacobian is that of numeric derivatives within 1e-7 m/rad") {
  test::Random random;
  const Pantograph arms;
  constexpr double h = 1e-5;  // rad.
  for (int i = 0; i < 1000; ++i) {
    const Vector2 theta = *arms.angles(place(random));
    const Matrix2 J = arms.handle(theta)->J;
    for (int k = 0; k < 2; ++k) {
      const Vector2 step = h * Vector2::Unit(k);
      const Vector2 slope = (arms.handle(theta + step)->p - arms.handle(theta - step)->p) / (2 * h);
      REQUIRE((J.col(k) - slope).norm() < 1e-7);
    }
  }
}

TEST_CASE("A symmetric pantograph holds its handle above the middle of its base") {
  const Pantograph arms{.base = 0.04, .upper_arm = 0.05, .forearm = 0.05};
  const auto handle = arms.handle({120 * kDegree, 60 * kDegree});
  REQUIRE(handle);
  // Elbows at (-0.025, 0.0433) and (0.065, 0.0433); the forearms rise by the root of 0.05² -
  // 0.045².
  CHECK(std::abs(handle->p.x() - 0.02) < 1e-15);
  CHECK(std::abs(handle->p.y() - (0.05 * std::sin(60 * kDegree) + std::sqrt(0.000475))) < 1e-15);
}

TEST_CASE("Where the forearms do not meet, or lie in one line, there is no handle") {
  const Pantograph short_arms{.base = 0.2, .upper_arm = 0.05, .forearm = 0.06};
  CHECK_FALSE(short_arms.handle({120 * kDegree, 60 * kDegree}));
  const Pantograph arms{.base = 0.04, .upper_arm = 0.05, .forearm = 0.0450001};
  CHECK_FALSE(arms.handle({120 * kDegree, 60 * kDegree}));
  CHECK_FALSE(arms.handle({std::numeric_limits<double>::quiet_NaN(), 0}));
  CHECK_FALSE(arms.angles({0, 1}));
}

TEST_CASE("A frame of torques is byte for byte as documented") {
  // The second arm is at port 1, which comes first: 0.5 is 0x3f000000, -2 is 0xc0000000.
  const DiyTorqueFrame expected{2, 5, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f};
  CHECK(encode_torques(5, {0.5, -2}) == expected);
  CHECK(*decode_torques(5, expected) == Vector2(0.5, -2));
  CHECK_FALSE(decode_torques(4, expected));
}

TEST_CASE("A setup is byte for byte as documented") {
  DiySetup setup;
  setup.clockwise = {false, true};
  // 12 is 0x41400000, 4880 is 0x45988000, 168 is 0x43280000.
  const DiySetupFrame expected{1,    5, 3,    0,    1,    3, 0, 1,    0,    0, 0,    0,    0x40,
                               0x41, 0, 0x80, 0x98, 0x45, 0, 0, 0x28, 0x43, 0, 0x80, 0x98, 0x45};
  CHECK(encode(5, setup) == expected);
  const auto decoded = decode_setup(5, expected);
  REQUIRE(decoded);
  CHECK(decoded->offset == setup.offset);
  CHECK(decoded->clockwise == setup.clockwise);
  CHECK(decoded->resolution == setup.resolution);
}

TEST_CASE("Angles come back within single precision, another board's and non-finite ones do not") {
  const Vector2 theta(168 * kDegree, 12 * kDegree);
  DiyAngleFrame frame = encode_angles(5, theta);
  CHECK((*decode_angles(5, frame) - theta).norm() < 3e-7);
  CHECK_FALSE(decode_angles(6, frame));
  frame[3] = frame[4] = 0xff;  // NaN.
  CHECK_FALSE(decode_angles(5, frame));
}

}  // namespace
}  // namespace hlm::server
