// Convex hulls as collision shapes: their faces, their separation, their features.
#include "hlm/geometry/hull.h"

#include <limits>
#include <numbers>
#include <set>

#include "tests/geometry/reference.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kTolerance = 1e-6;  // m: what is promised.
constexpr double kEpsilon = 0.006;   // m.

Hull box_points(const Vector3& size) {
  Hull hull;
  for (int i = 0; i < 8; ++i) {
    hull.vertices.push_back(
        size.cwiseProduct(Vector3(i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5)));
  }
  return hull;
}

/// A round bar along z.
Hull prism(int sides, double radius, double length) {
  Hull hull;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    for (const double z : {-length / 2, length / 2}) {
      hull.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  }
  return hull;
}

std::set<std::pair<Feature, Feature>> keys_of(const Manifold& manifold) {
  std::set<std::pair<Feature, Feature>> keys;
  for (const ManifoldPoint& point : manifold) keys.insert({point.tool_feature, point.body_feature});
  return keys;
}

}  // namespace

TEST_CASE("The hull of a box's corners, edge points and inside has six faces of four corners") {
  Random random;
  Hull hull = box_points({0.02, 0.04, 0.06});
  hull.vertices.emplace_back(0.01, 0.02, 0.001);
  hull.vertices.emplace_back(0.01, 0.003, 0.002);
  for (int i = 0; i < 20; ++i) {
    hull.vertices.push_back(random.vector(1).cwiseProduct(Vector3(0.009, 0.019, 0.029)));
  }
  const HullFaces faces = convex_hull(hull.vertices);
  CHECK(faces.vertices.size() == 8);
  REQUIRE(faces.loops.size() == 6);
  for (std::size_t i = 0; i < 6; ++i) {
    REQUIRE(faces.loops[i].size() == 4);
    CHECK(faces.normals[i].cwiseAbs().maxCoeff() == Approx(1).margin(1e-12));
    const auto corner = [&](std::size_t k) { return faces.vertices[faces.loops[i][k % 4]]; };
    CHECK(faces.normals[i].dot(corner(0)) > 0);
    for (std::size_t k = 0; k < 4; ++k) {
      const Vector3 turn = (corner(k + 1) - corner(k)).cross(corner(k + 2) - corner(k + 1));
      CHECK(turn.dot(faces.normals[i]) > 0);
    }
  }
}

TEST_CASE("Points that have no hull are refused in one line that says why") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Vector3> flat{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 1e-7}};
  CHECK_THROWS_WITH(convex_hull(flat), ContainsSubstring("lie in a plane"));
  flat.assign(5, Vector3(1, 2, 3));
  CHECK_THROWS_WITH(convex_hull(flat), ContainsSubstring("lie in a plane"));
  flat.resize(3);
  CHECK_THROWS_WITH(convex_hull(flat), ContainsSubstring("3 points; at least 4"));
  CHECK_THROWS_WITH(convex_hull(std::vector<Vector3>(4, Vector3(nan, 0, 0))),
                    ContainsSubstring("coordinate nan m must be"));
  CHECK_THROWS_WITH(convex_hull(std::vector<Vector3>(4, Vector3(0, 2000, 0))),
                    ContainsSubstring("coordinate 2000 m must be"));
  Random random;
  std::vector<Vector3> many;
  for (int i = 0; i < 5000; ++i) many.push_back(random.direction());
  CHECK_THROWS_WITH(convex_hull(many), ContainsSubstring("at most 4096 are allowed"));
}

TEST_CASE("Climbing finds the farthest vertex of a hull of any size") {
  Random random;
  for (const int vertices : {4, 8, 100, 127, 128, 200, 512, 2000}) {
    const Hull hull = random_hull(vertices, random);
    const Convex convex(hull);
    for (int i = 0; i < 500; ++i) {
      const Vector3 n =
          i < 6 ? Vector3((i % 2 ? 1 : -1) * Vector3::Unit(i / 2)) : random.direction();
      CHECK(convex.support(n).dot(n) == Approx(extent_along({hull, Pose{}}, n)).margin(1e-15));
    }
  }
}

TEST_CASE("The separation of hulls is that of the origin from the hull of all differences",
          "[optimised]") {
  Random random;
  ProximityStatistics statistics;
  int compared = 0;
  for (int i = 0; i < 1200; ++i) {
    const int sizes[] = {4, 8, 8, 16, 32};
    const Hull a = random_hull(sizes[i % 5], random);
    const Hull b = i % 50 == 0 ? random_hull(512, random) : random_hull(sizes[i / 5 % 5], random);
    const Pose X_WB = random.pose(0.5);
    Pose X_WA{X_WB.p + random.uniform(0, 0.1) * random.direction(), random.rotation()};
    if (i % 3 == 0) X_WA.R = X_WB.R;
    // From 20 mm deep to 6 mm apart; one in four at touch.
    const double present = hull_separation(a, X_WA, b, X_WB);
    const Manifold before = contacts_of({a, X_WA}, {b, X_WB}, 1);
    const double target = i % 4 == 0 ? random.uniform(-2e-6, 2e-6) : random.uniform(-0.02, 0.006);
    X_WA.p += (target - present) * before.front().n_W;
    const double expected = hull_separation(a, X_WA, b, X_WB);
    if (expected < -0.02 || expected > kEpsilon - kTolerance) continue;
    ++compared;
    CAPTURE(i, expected);
    const Manifold manifold = contacts_of({a, X_WA}, {b, X_WB}, kEpsilon, statistics);
    REQUIRE_FALSE(manifold.empty());
    CHECK(std::abs(smallest_separation(manifold) - expected) < kTolerance);
    CHECK(std::abs(gap_along({a, X_WA}, {b, X_WB}, manifold[0].n_W) - expected) < kTolerance);
    CHECK(has_unique_keys(manifold));
  }
  CHECK(compared > 1000);
  CHECK(statistics.failures == 0);
}

TEST_CASE("A hull of a box's corners touches as the box does") {
  Random random;
  int compared = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3 size(random.uniform(0.01, 0.1), random.uniform(0.01, 0.1), 0.04);
    const Placed body{Box{Vector3(0.2, 0.2, 0.1)}, random.pose(0.2)};
    const Quaternion turn = rotation_from_vector(0.02 * random.direction());
    const Pose X_WT{body.X_WS * Vector3(random.uniform(-0.1, 0.1), 0.02, 0.07), body.X_WS.R * turn};
    const Manifold box = contacts_of({Box{size}, X_WT}, body, kEpsilon);
    const Manifold hull = contacts_of({box_points(size), X_WT}, body, kEpsilon);
    REQUIRE(hull.size() == box.size());
    for (const ManifoldPoint& point : box) {
      ++compared;
      CHECK(std::any_of(hull.begin(), hull.end(), [&](const ManifoldPoint& other) {
        return (other.p_WC - point.p_WC).norm() < 1e-9 && (other.n_W - point.n_W).norm() < 1e-9 &&
               std::abs(other.separation - point.separation) < 1e-9;
      }));
    }
  }
  CHECK(compared > 500);
}

TEST_CASE("A bar of 64 sides stands on a spread part of its rim, and rocks without other contacts",
          "[optimised]") {
  Random random;
  const Hull bar = prism(64, 0.02, 0.06);
  const Placed floor{Box{Vector3(0.4, 0.4, 0.1)},
                     Pose{Vector3(0, 0, -0.05), Quaternion::Identity()}};
  Placed tool{bar, Pose{Vector3(0, 0, 0.0299), Quaternion::Identity()}};
  const Manifold standing = contacts_of(tool, floor, kEpsilon);
  REQUIRE(standing.size() >= 8);
  Vector3 mean = Vector3::Zero();
  for (const ManifoldPoint& point : standing) mean += point.p_WC / double(standing.size());
  CHECK(mean.norm() < 0.005);
  const auto expected = keys_of(standing);
  int changes = 0;
  for (int i = 0; i < 1000; ++i) {
    tool.X_WS.p += random.vector(1e-6);
    const auto keys = keys_of(contacts_of(tool, floor, kEpsilon));
    changes += keys != expected;
  }
  CHECK(changes == 0);
}

TEST_CASE("A ball beside the rim of a bar of 85 sides keeps its contact's identity",
          "[optimised]") {
  constexpr int kSides = 85;
  Random random;
  const Placed bar{prism(kSides, 0.05, 0.06), Pose{}};
  for (int side = 0; side < kSides; ++side) {
    const double angle = 2 * std::numbers::pi * (side + 0.5) / kSides;
    const double apothem = 0.05 * std::cos(std::numbers::pi / kSides);
    const Vector3 beside = 0.015 * Vector3(std::cos(angle), std::sin(angle), 1);
    const Vector3 rim(apothem * std::cos(angle), apothem * std::sin(angle), 0.03);
    Placed ball{Sphere{0.02}, {rim + beside, Quaternion::Identity()}};
    const auto expected = keys_of(contacts_of(ball, bar, kEpsilon));
    REQUIRE(expected.size() == 1);
    CHECK(expected.begin()->second.kind == FeatureKind::kEdge);
    int changes = 0;
    for (int i = 0; i < 10; ++i) {
      ball.X_WS.p += random.vector(1e-6);
      changes += keys_of(contacts_of(ball, bar, kEpsilon)) != expected;
    }
    CHECK(changes == 0);
  }
}

TEST_CASE("The deepest contact of hulls keeps its identity over small steps", "[optimised]") {
  const auto deepest = [](const Manifold& manifold) {
    const auto found = std::min_element(
        manifold.begin(), manifold.end(),
        [](const auto& a, const auto& b) { return a.separation < b.separation - 1e-9; });
    return std::pair(found->tool_feature, found->body_feature);
  };
  Random random;
  int changes = 0;
  for (int pair = 0; pair < 20; ++pair) {
    const Hull a = random_hull(12, random);
    const Hull b = random_hull(12, random);
    Placed tool{a, {0.2 * random.direction(), random.rotation()}};
    const Placed body{b, Pose{}};
    const Manifold far = contacts_of(tool, body, 1);
    tool.X_WS.p += (random.uniform(-0.002, 0.002) - smallest_separation(far)) * far[0].n_W;
    auto before = deepest(contacts_of(tool, body, kEpsilon));
    const Vector3 step = 1e-6 * random.direction();
    for (int i = 0; i < 500; ++i) {
      tool.X_WS.p += step;
      const auto now = deepest(contacts_of(tool, body, kEpsilon));
      changes += now != before;
      before = now;
    }
  }
  CHECK(changes <= 20);  // Over 10 mm in all, on features some millimetres wide.
}

}  // namespace hlm::geometry::test
