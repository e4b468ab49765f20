// Shapes as contact detection sees them: supports, bounds, features, sizes that are refused.
#include "hlm/geometry/convex.h"

#include <limits>
#include <set>

#include "tests/geometry/reference.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {

TEST_CASE("The support plus the margin is the extent of the shape in every direction") {
  Random random;
  for (int i = 0; i < 200; ++i) {
    const Shape shape = random_shape(i % kShapeKinds, random);
    const Convex convex(shape);
    const Vector3 n = random.direction();
    CHECK(convex.support(n).dot(n) + convex.margin() ==
          Approx(extent_along({shape, Pose{}}, n)).margin(1e-15));
  }
}

TEST_CASE("Bounds are the smallest box in the world that holds the shape") {
  Random random;
  for (int i = 0; i < 200; ++i) {
    const Placed placed{random_shape(i % kShapeKinds, random), random.pose(1)};
    const Eigen::AlignedBox3d box = Convex(placed.shape).bounds(placed.X_WS);
    for (int axis = 0; axis < 3; ++axis) {
      CHECK(box.max()[axis] == Approx(extent_along(placed, Vector3::Unit(axis))).margin(1e-14));
      CHECK(box.min()[axis] == Approx(-extent_along(placed, -Vector3::Unit(axis))).margin(1e-14));
    }
  }
}

TEST_CASE("Half extents are those in the shape's own frame, and infinite for a half-space") {
  CHECK(Convex(Box{Vector3(0.02, 0.04, 0.06)}).half_extents().isApprox(Vector3(0.01, 0.02, 0.03)));
  CHECK(Convex(Capsule{0.01, 0.04}).half_extents().isApprox(Vector3(0.01, 0.01, 0.03)));
  CHECK(Convex(Cylinder{0.01, 0.04}).half_extents().isApprox(Vector3(0.01, 0.01, 0.02)));
  CHECK(Convex(Sphere{0.01}).half_extents().isApprox(Vector3(0.01, 0.01, 0.01)));
  const Convex half_space(HalfSpace{});
  CHECK((half_space.half_extents().array() == std::numeric_limits<double>::infinity()).all());
  CHECK(half_space.bounds(Pose{}).contains(Vector3(1e6, -1e6, 1e6)));
}

TEST_CASE("Vertices, edges and faces of a box have one number each, the same for every box") {
  const Convex small(Box{Vector3(0.01, 0.02, 0.03)});
  const Convex large(Box{Vector3(0.3, 0.1, 0.2)});
  std::set<std::uint16_t> vertices;
  std::set<std::uint16_t> edges;
  std::set<std::uint16_t> faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const Patch patch = small.facing(sign * Vector3::Unit(axis));
      const Patch same = large.facing(sign * Vector3::Unit(axis));
      REQUIRE(patch.corners.size() == 4);
      CHECK(patch.feature == same.feature);
      CHECK(patch.feature.index == 2 * axis + (sign > 0));
      faces.insert(patch.feature.index);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto& corner = patch.corners[i];
        CHECK(corner.vertex == same.corners[i].vertex);
        CHECK(corner.side == same.corners[i].side);
        CHECK(small.feature_at(corner.p) == corner.vertex);
        CHECK(small.feature_at((corner.p + patch.corners[(i + 1) % 4].p) / 2) == corner.side);
        vertices.insert(corner.vertex.index);
        edges.insert(corner.side.index);
      }
      const Vector3 along = patch.corners[1].p - patch.corners[0].p;
      const Vector3 across = patch.corners[2].p - patch.corners[1].p;
      CHECK(along.cross(across).normalized().isApprox(patch.normal));
    }
  }
  CHECK(vertices.size() == 8);
  CHECK(edges.size() == 12);
  CHECK(faces.size() == 6);
}

TEST_CASE("The corners of a cylinder's cap lie on its rim, at angles fixed to the body") {
  const Cylinder cylinder{0.03, 0.1};
  const Convex convex(cylinder);
  for (const double sign : {-1.0, 1.0}) {
    const Patch cap = convex.facing(Vector3(0.1, 0.2, sign).normalized());
    REQUIRE(cap.is_face());
    for (const auto& corner : cap.corners) {
      CHECK(corner.p.head<2>().norm() == Approx(cylinder.radius).epsilon(1e-12));
      CHECK(corner.p.z() == sign * cylinder.length / 2);
      CHECK(convex.feature_at(corner.p).kind == FeatureKind::kEdge);
    }
    CHECK(cap.corners.size() ==
          convex.facing(Vector3(-0.2, 0.1, sign).normalized()).corners.size());
  }
  const Patch line = convex.facing(Vector3(0.6, 0.8, 0.1).normalized());
  REQUIRE(line.corners.size() == 2);
  CHECK(line.corners[0].p.isApprox(Vector3(0.018, 0.024, -0.05)));
  CHECK(line.feature == convex.facing(Vector3(-1, 0, 0)).feature);
}

TEST_CASE("Sizes that are not finite and positive are refused with the name and the value") {
  using Catch::Matchers::ContainsSubstring;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(Convex(Sphere{0}), ContainsSubstring("sphere radius 0 m"));
  CHECK_THROWS_WITH(Convex(Sphere{nan}), ContainsSubstring("sphere radius nan m"));
  CHECK_THROWS_WITH(Convex(Capsule{0.1, -1}), ContainsSubstring("capsule length -1 m"));
  CHECK_THROWS_WITH(Convex(Cylinder{-2, 1}), ContainsSubstring("cylinder radius -2 m"));
  CHECK_THROWS_WITH(Convex(Box{Vector3(1, 0, 1)}), ContainsSubstring("box size y 0 m"));
  CHECK_THROWS_AS(Convex(Box{Vector3(1, 1, std::numeric_limits<double>::infinity())}),
                  std::invalid_argument);
}

}  // namespace hlm::geometry::test
