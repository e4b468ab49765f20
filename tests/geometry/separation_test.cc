// Signed distances and normals of pairs, against independent references.
#include <algorithm>
#include <cmath>
#include <limits>

#include "hlm/geometry/tolerances.h"
#include "tests/geometry/signed_distance.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

constexpr double kTolerance = 1e-6;  // m: what is promised.
constexpr double kRounding = 1e-12;  // m: where a closed form holds.
constexpr double kEpsilon = 0.006;   // m.
constexpr double kDeepest = -0.02;   // m.

/// A body anywhere and a tool near it, centres within 0.12 m.
std::pair<Placed, Placed> random_pair(int tool_kind, int body_kind, Turn turn, Random& random) {
  Placed body{random_shape(body_kind, random), random.pose(0.5)};
  Placed tool{random_shape(tool_kind, random), Pose{}};
  tool.X_WS.R = body.X_WS.R * random_turn(turn, random);
  tool.X_WS.p = body.X_WS.p + random.uniform(0, 0.12) * random.direction();
  return {tool, body};
}

/// Both points of every contact lie on the shapes' surfaces; at the end of a capsule that is turned
/// away they lie on the sphere about that end, inside the capsule.
void check_points(const Manifold& manifold, const Placed& tool, const Placed& body) {
  for (const ManifoldPoint& point : manifold) {
    // Nearly parallel edges have their contacts beside them.
    const bool of_edges = point.tool_feature.kind != FeatureKind::kFace &&
                          point.body_feature.kind != FeatureKind::kFace;
    const double tolerance = of_edges ? 1e-4 : 2 * kTolerance;
    const auto check_on_surface = [&](const Placed& placed, const Vector3& p_W) {
      const double distance = distance_to_surface(placed, p_W);
      CHECK(distance < tolerance);
      if (!std::holds_alternative<Capsule>(placed.shape)) CHECK(distance > -tolerance);
    };
    CHECK(point.n_W.norm() == Approx(1).epsilon(kRounding));
    check_on_surface(body, point.p_WC);
    check_on_surface(tool, point.p_WC + point.separation * point.n_W);
  }
}

/// A hull of 3 to 30 m: a boulder, a wedge with a straight edge along y, or a leaf.
Hull large_hull(int kind, Random& random) {
  const auto log_uniform = [&](double low, double high) {
    return std::exp(random.uniform(std::log(low), std::log(high)));
  };
  const double half = log_uniform(3, 30) / 2;
  const double flat = kind == 0 ? 1 : log_uniform(1e-3, 0.3);
  Hull hull;
  if (kind == 1) {
    for (const double y : {-half, half}) {
      hull.vertices.emplace_back(0, y, 0);
      hull.vertices.emplace_back(flat * half, y, -half);
      hull.vertices.emplace_back(-flat * half, y, -half);
    }
    return hull;
  }
  for (int i = 0; i < 20; ++i) {
    hull.vertices.push_back(half * random.direction().cwiseProduct(Vector3(1, 1, flat)));
  }
  return hull;
}

/// Poses of tools of 10 to 100 mm at the edges of hulls of metres, from 5 mm deep to 5 mm apart,
/// one in five within 2 µm of touch. None may be missed or refused, and of those apart each is
/// right.
void check_on_large_hulls(int hulls) {
  Random random;
  ProximityStatistics statistics;
  long missed = 0;
  double error = 0;  // Largest, m.
  for (int i = 0; i < hulls; ++i) {
    const Hull hull = large_hull(i % 3, random);
    const Placed body{hull, random.pose(1)};
    const Convex body_convex(hull);
    for (int k = 0; k < 5; ++k) {
      // Two vertices near each other are the ends of an edge, often.
      const Vector3 up = i % 3 == 1
                             ? Vector3(Vector3::UnitZ() + 0.3 * random.direction()).normalized()
                             : random.direction();
      const Vector3 from = body_convex.support(up);
      const Vector3 to = body_convex.support((up + 0.3 * random.direction()).normalized());
      const Shape shape = random_shape(k % 2 == 0 ? 2 : 4, random);
      const Vector3 p_B = from + random.uniform(0, 1) * (to - from) + 0.1 * up;
      Placed tool{shape, {body.X_WS * p_B, random.rotation()}};
      const DistanceBounds apart = signed_distance(tool, body);
      const double target = k == 0 ? random.uniform(-2e-6, 2e-6) : random.uniform(-0.005, 0.005);
      tool.X_WS.p += (target - apart.lower) * apart.n_W;
      const Manifold manifold =
          find_contacts(Convex(shape), tool.X_WS, body_convex, body.X_WS, kEpsilon, statistics);
      missed += manifold.empty();
      if (target < 0) continue;  // Another way out may be shorter.
      error = std::max(error, std::abs(smallest_separation(manifold) - target));
    }
  }
  CHECK(missed == 0);
  CHECK(statistics.failures == 0);
  CHECK(error < kTolerance);
}

}  // namespace

TEST_CASE("The separation of boxes is that of enumerated features, within a micrometre") {
  Random random;
  int compared = 0;
  int apart = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto [tool, body] = random_pair(3, 3, kTurns[i % 4], random);
    const double expected =
        box_separation(std::get<Box>(tool.shape), tool.X_WS, std::get<Box>(body.shape), body.X_WS);
    if (expected < kDeepest) continue;
    const Manifold manifold = contacts_of(tool, body, kEpsilon);
    if (expected > kEpsilon + kTolerance) {
      ++apart;
      CHECK(manifold.empty());
    } else if (expected < kEpsilon - kTolerance) {
      ++compared;
      REQUIRE_FALSE(manifold.empty());
      CHECK(std::abs(smallest_separation(manifold) - expected) < kTolerance);
      CHECK(std::abs(gap_along(tool, body, manifold[0].n_W) - expected) < kTolerance);
      check_points(manifold, tool, body);
      CHECK(has_unique_keys(manifold));
    }
  }
  CHECK(compared > 700);
  CHECK(apart > 200);
}

TEST_CASE("Boxes that touch to within a micrometre keep the separation's accuracy") {
  Random random;
  for (int i = 0; i < 120; ++i) {
    auto [tool, body] = random_pair(3, 3, kTurns[i % 4], random);
    const Manifold before = contacts_of(tool, body, 0.2);
    const double target = random.uniform(-2e-6, 2e-6);
    tool.X_WS.p += (target - smallest_separation(before)) * before[0].n_W;
    const double expected =
        box_separation(std::get<Box>(tool.shape), tool.X_WS, std::get<Box>(body.shape), body.X_WS);
    const Manifold manifold = contacts_of(tool, body, kEpsilon);
    REQUIRE_FALSE(manifold.empty());
    CHECK(std::abs(smallest_separation(manifold) - expected) < kTolerance);
  }
}

TEST_CASE("No direction has a larger gap than the separation, for every pair of shapes") {
  constexpr int kPairs = 60 * kShapeKinds * kShapeKinds;
  Random random;
  ProximityStatistics statistics;
  int compared = 0;
  for (int i = 0; i < kPairs; ++i) {
    const auto [tool, body] = random_pair(i % kShapeKinds, i / kShapeKinds % kShapeKinds,
                                          kTurns[i / (kShapeKinds * kShapeKinds) % 4], random);
    const Manifold manifold = contacts_of(tool, body, kEpsilon, statistics);
    if (manifold.empty()) continue;
    const double separation = smallest_separation(manifold);
    if (separation < kDeepest) continue;
    ++compared;
    const Vector3& n = manifold[0].n_W;
    CHECK(std::abs(gap_along(tool, body, n) - separation) < kTolerance);
    CHECK(largest_gap(tool, body, n, random) < separation + kTolerance);
    check_points(manifold, tool, body);
    CHECK(has_unique_keys(manifold));
    for (const ManifoldPoint& point : manifold) CHECK(point.separation > separation - kTolerance);
  }
  CHECK(compared > 400);
  CHECK(statistics.queries == kPairs);
  CHECK(statistics.failures == 0);
}

TEST_CASE("Two spheres are apart by the distance of their centres minus their radii") {
  Random random;
  for (int i = 0; i < 100; ++i) {
    const auto [tool, body] = random_pair(0, 0, Turn::kAny, random);
    const Vector3 between = tool.X_WS.p - body.X_WS.p;
    const double expected =
        between.norm() - std::get<Sphere>(tool.shape).radius - std::get<Sphere>(body.shape).radius;
    const Manifold manifold = contacts_of(tool, body, 1);
    REQUIRE(manifold.size() == 1);
    CHECK(manifold[0].separation == Approx(expected).margin(kRounding));
    CHECK(manifold[0].n_W.isApprox(between.normalized(), 1e-9));
  }
}

TEST_CASE("A sphere is apart from a body by its centre's distance to the surface, however deep") {
  Random random;
  for (int kind = 0; kind < 4; ++kind) {
    for (int i = 0; i < 200; ++i) {
      const auto [tool, body] = random_pair(0, kind, kTurns[i % 4], random);
      const double expected =
          distance_to_surface(body, tool.X_WS.p) - std::get<Sphere>(tool.shape).radius;
      const Manifold manifold = contacts_of(tool, body, 1);
      REQUIRE(manifold.size() == 1);
      CHECK(manifold[0].separation == Approx(expected).margin(1e-9));
      const Manifold exchanged = contacts_of(body, tool, 1);
      REQUIRE(exchanged.size() == 1);
      CHECK(exchanged[0].separation == Approx(expected).margin(1e-9));
      CHECK(exchanged[0].n_W.isApprox(-manifold[0].n_W, 1e-6));
    }
  }
}

TEST_CASE(
    "A shape over a half-space is apart from it by its lowest point, along the plane's normal") {
  Random random;
  for (int i = 0; i < 400; ++i) {
    const Placed plane{HalfSpace{}, random.pose(1)};
    Placed tool{random_shape(i % 4, random), random.pose(0.1)};
    const Vector3 up = plane.X_WS.R * Vector3::UnitZ();
    const double expected = random.uniform(kDeepest, kEpsilon);
    tool.X_WS.p += (expected + plane.X_WS.p.dot(up) + extent_along(tool, -up)) * up;
    const Manifold manifold = contacts_of(tool, plane, kEpsilon);
    CHECK(std::abs(smallest_separation(manifold) - expected) < kTolerance);
    for (const ManifoldPoint& point : manifold) {
      CHECK(point.n_W.isApprox(up));
      CHECK(point.body_feature == Feature{FeatureKind::kFace, 0, 0});
      CHECK(std::abs(distance_to_surface(plane, point.p_WC)) < kRounding);
    }
  }
}

TEST_CASE("Cores without volume that overlap have a separation of minus both radii") {
  const Pose turned{Vector3::Zero(), rotation_from_vector(Vector3(0.4, 0, 0))};
  const Pose shifted{Vector3(0, 0, 0.01), Quaternion::Identity()};
  const Placed sphere{Sphere{0.01}, Pose{}};
  const Placed capsule{Capsule{0.02, 0.05}, Pose{}};
  CHECK(smallest_separation(contacts_of(sphere, sphere, 0)) == Approx(-0.02).margin(kRounding));
  CHECK(smallest_separation(contacts_of({Sphere{0.01}, shifted}, capsule, 0)) ==
        Approx(-0.03).margin(kRounding));
  CHECK(smallest_separation(contacts_of({Capsule{0.02, 0.05}, shifted}, capsule, 0)) ==
        Approx(-0.04).margin(kRounding));
  CHECK(smallest_separation(contacts_of({Capsule{0.02, 0.05}, turned}, capsule, 0)) ==
        Approx(-0.04).margin(kRounding));
}

TEST_CASE("A capsule's end in a cylinder is pushed out along the cylinder's radius, to 1 mrad") {
  Random random;
  const Cylinder cylinder{0.05, 0.2};
  const Capsule capsule{0.01, 0.06};
  for (int i = 0; i < 200; ++i) {
    const double angle = random.uniform(-3, 3);
    const double depth = random.uniform(1e-4, 0.008);
    const Vector3 radial(std::cos(angle), std::sin(angle), 0);
    const Vector3 end =
        (cylinder.radius - depth) * radial + random.uniform(-0.05, 0.05) * Vector3::UnitZ();
    // The capsule's axis points out of the cylinder.
    const Vector3 axis = (radial + 0.5 * random.direction()).normalized();
    const Quaternion R = Quaternion::FromTwoVectors(Vector3::UnitZ(), axis);
    const Pose X_WB = random.pose(0.5);
    const Placed tool{capsule, X_WB * Pose{end + capsule.length / 2 * axis, R}};
    const Manifold manifold = contacts_of(tool, {cylinder, X_WB}, kEpsilon);
    REQUIRE_FALSE(manifold.empty());
    CHECK(std::abs(smallest_separation(manifold) + depth + capsule.radius) < kTolerance);
    CHECK((manifold[0].n_W - X_WB.R * radial).norm() < 1e-3);
  }
}

TEST_CASE(
    "On the very axis of a cylinder, where many normals are as good, an answer is exact or "
    "refused") {
  const Placed tool{Capsule{0.01, 0.1}, Pose{}};
  const Placed body{Cylinder{0.05, 0.3}, Pose{}};
  ProximityStatistics statistics;
  const Manifold manifold = contacts_of(tool, body, kEpsilon, statistics);
  CHECK(statistics.failures == (manifold.empty() ? 1 : 0));
  if (!manifold.empty()) {
    CHECK(std::abs(smallest_separation(manifold) + 0.06) < kTolerance);
  }
}

TEST_CASE("Moving both shapes rigidly moves their contacts with them") {
  Random random;
  for (int i = 0; i < 300; ++i) {
    const auto [tool, body] = random_pair(3, i % 2 == 0 ? 3 : 1, Turn::kAny, random);
    const Pose X = random.pose(1);
    const Manifold here = contacts_of(tool, body, kEpsilon);
    const Manifold there =
        contacts_of({tool.shape, X * tool.X_WS}, {body.shape, X * body.X_WS}, kEpsilon);
    REQUIRE(here.size() == there.size());
    for (std::size_t k = 0; k < here.size(); ++k) {
      CHECK(here[k].tool_feature == there[k].tool_feature);
      CHECK(here[k].body_feature == there[k].body_feature);
      CHECK(here[k].separation == Approx(there[k].separation).margin(1e-9));
      CHECK((X * here[k].p_WC - there[k].p_WC).norm() < 1e-9);
      CHECK((X.R * here[k].n_W - there[k].n_W).norm() < 1e-9);
    }
  }
}

TEST_CASE("Small cylinders at touch are never refused, and exact to a micrometre", "[optimised]") {
  Random random;
  ProximityStatistics statistics;
  for (int i = 0; i < 3000; ++i) {
    const auto small = [&] {
      return Cylinder{random.uniform(0.0005, 0.005), random.uniform(0.001, 0.01)};
    };
    const Placed body{small(), random.pose(0.1)};
    Placed tool{small(), {body.X_WS.p, body.X_WS.R * random_turn(kTurns[i % 4], random)}};
    tool.X_WS.p += random.uniform(0.001, 0.02) * random.direction();
    const Manifold before = contacts_of(tool, body, 1);
    tool.X_WS.p += (random.uniform(-5e-6, 2e-6) - smallest_separation(before)) * before.front().n_W;
    const Manifold manifold = contacts_of(tool, body, kEpsilon, statistics);
    REQUIRE_FALSE(manifold.empty());
    const double separation = smallest_separation(manifold);
    CHECK(largest_gap(tool, body, manifold[0].n_W, random) < separation + kTolerance);
  }
  CHECK(statistics.failures == 0);
}

TEST_CASE("No contact of a tool on a hull of 3 to 30 m is missed or refused", "[optimised]") {
  check_on_large_hulls(600);
}
TEST_CASE("The same over 100,000 poses", "[.][survey]") { check_on_large_hulls(20'000); }

TEST_CASE("An answer that the supports do not confirm is counted and makes no contact") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Shape bodies[] = {Sphere{0.1}, Capsule{0.1, 0.1}, Cylinder{0.1, 0.1},
                          Box{Vector3(0.1, 0.1, 0.1)}, HalfSpace{}};
  ProximityStatistics statistics;
  for (const Shape& body : bodies) {
    for (const double bad : {nan, infinity}) {
      const Placed tool{Box{Vector3(0.1, 0.1, 0.1)}, {Vector3(0, 0, bad), Quaternion::Identity()}};
      const auto failures = statistics.failures;
      const Manifold manifold = contacts_of(tool, {body, Pose{}}, kEpsilon, statistics);
      CHECK(manifold.empty());
      if (std::isnan(bad)) CHECK(statistics.failures == failures + 1);
    }
    const Placed turned{Box{Vector3(0.1, 0.1, 0.1)}, {Vector3::Zero(), Quaternion(nan, 0, 0, 0)}};
    const auto failures = statistics.failures;
    CHECK(contacts_of(turned, {body, Pose{}}, kEpsilon, statistics).empty());
    CHECK(statistics.failures == failures + 1);
  }
}

TEST_CASE("Extremely thin and extremely long shapes give true contacts or counted failures") {
  Random random;
  ProximityStatistics statistics;
  int contacts = 0;
  const auto size = [&] { return std::pow(10, random.uniform(-9, 1)); };
  for (int i = 0; i < 600; ++i) {
    Placed body{Box{Vector3(size(), size(), size())}, Pose{}};
    Placed tool{
        i % 2 == 0 ? Shape(Box{Vector3(size(), size(), size())}) : Shape(Cylinder{size(), size()}),
        Pose{0.02 * random.direction(), random_turn(kTurns[i / 2 % 4], random)}};
    for (const ManifoldPoint& point : contacts_of(tool, body, kEpsilon, statistics)) {
      ++contacts;
      CHECK(point.p_WC.allFinite());
      CHECK(point.separation <= kEpsilon);
      CHECK(gap_along(tool, body, point.n_W) < point.separation + kTolerance);
    }
  }
  CHECK(contacts > 100);
}

TEST_CASE("A cylinder that is nearly parallel to a box is not refused, though nothing may allocate",
          "[optimised]") {
  Random random;
  ProximityStatistics statistics;
  for (int i = 0; i < 40000; ++i) {
    const Convex cylinder(random_shape(2, random));
    const Convex box(random_shape(3, random));
    const Pose X_WB = random.pose(0.5);
    Pose X_WT{X_WB.p + random.vector(0.05), X_WB.R * random_turn(Turn::kNearlyParallel, random)};
    const auto find = [&] {
      return find_contacts(cylinder, X_WT, box, X_WB, 0.002, statistics, {}, false);
    };
    const Manifold deep = find();
    const double separation = smallest_separation(deep);
    if (separation > 0) continue;
    statistics.failures = 0;  // That may be deeper than is promised.
    X_WT.p -= (separation + random.uniform(0, narrow::kDeepest)) * deep[0].n_W;
    find();
    CHECK(statistics.failures == 0);
  }
}

}  // namespace hlm::geometry::test
