// The paper's peg, in three dimensions, in a hole of five walls.
#include <array>

#include "tests/geometry/reference.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

constexpr double kEpsilon = 0.005;  // m.
const Box kPeg{Vector3(0.04, 0.04, 0.08)};

/// Walls of a hole along z whose floor is at z = 0, wider than the peg by `clearance` in x and y.
/// They reach below the floor, and `depth` above it.
std::array<Placed, 5> hole(double clearance, double depth) {
  const double thick = 0.06;
  const double offset = (kPeg.size.x() + clearance + thick) / 2;
  const Box side{Vector3(thick, 0.2, depth + thick)};
  const Box front{Vector3(0.2, thick, depth + thick)};
  const double z = (depth - thick) / 2;
  const auto at = [](double x, double y, double height) {
    return Pose{Vector3(x, y, height), Quaternion::Identity()};
  };
  return {Placed{side, at(-offset, 0, z)}, Placed{side, at(offset, 0, z)},
          Placed{front, at(0, -offset, z)}, Placed{front, at(0, offset, z)},
          Placed{Box{Vector3(0.2, 0.2, thick)}, at(0, 0, -thick / 2)}};
}

}  // namespace

TEST_CASE("A peg in a hole has 4 contacts on every wall, 20 in all, at any clearance and tilt") {
  Random random;
  for (const double depth : {0.06, 0.1}) {
    for (int i = 0; i < 80; ++i) {
      const double clearance = i % 8 == 0 ? 0 : random.uniform(0, 0.004);
      const double tilt = i % 5 == 0 ? 0 : random.uniform(0, 0.02);
      const auto walls = hole(clearance, depth);
      const double floor_gap = random.uniform(-0.001, 0.002);
      const Vector3 shift(random.uniform(-1, 1), random.uniform(-1, 1), 0);
      const Placed peg{kPeg,
                       {clearance / 4 * shift + Vector3(0, 0, 0.04 + floor_gap),
                        rotation_from_vector(tilt * random.direction())}};
      for (const Placed& wall : walls) {
        const Manifold manifold = contacts_of(peg, wall, kEpsilon);
        CHECK(manifold.size() == 4);
        CHECK(has_unique_keys(manifold));
        const double expected =
            box_separation(kPeg, peg.X_WS, std::get<Box>(wall.shape), wall.X_WS);
        CHECK(std::abs(smallest_separation(manifold) - expected) < 1e-6);
      }
    }
  }
}

TEST_CASE("The contacts of a peg in a hole keep their identities while it moves and tilts") {
  Random random;
  const auto walls = hole(0.002, 0.06);
  const Placed rest{kPeg, {Vector3(0, 0, 0.04), Quaternion::Identity()}};
  for (const Placed& wall : walls) {
    Manifold before = contacts_of(rest, wall, kEpsilon);
    for (int i = 0; i < 50; ++i) {
      Placed peg = rest;
      peg.X_WS.p += random.vector(0.0005);
      peg.X_WS.R = rotation_from_vector(random.uniform(0, 0.02) * random.direction());
      const Manifold manifold = contacts_of(peg, wall, kEpsilon);
      REQUIRE(manifold.size() == before.size());
      for (const ManifoldPoint& point : manifold) {
        const auto same = [&](const ManifoldPoint& other) {
          return other.tool_feature == point.tool_feature &&
                 other.body_feature == point.body_feature;
        };
        CHECK(std::any_of(before.begin(), before.end(), same));
      }
    }
  }
}

}  // namespace hlm::geometry::test
