// Do all near axes of a pair tell, wherever the tool goes, whether the shapes are apart?
#include <algorithm>
#include <limits>
#include <set>
#include <tuple>
#include <vector>

#include "tests/geometry/signed_distance.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::geometry::test {
namespace {

constexpr double kEpsilon = 0.02;  // m

AxesManifold axes_of(const Placed& tool, const Placed& body, double epsilon = kEpsilon) {
  ProximityStatistics statistics;
  return find_axes(Convex(tool.shape), tool.X_WS, Convex(body.shape), body.X_WS, epsilon,
                   statistics);
}

/// The greatest gap of all axes once the tool has moved by d_W and turned by `turn`, m. The normal
/// of a plane of the tool turns with it.
double gap_after(const AxesManifold& manifold, const Placed& tool, const Vector3& d_W,
                 const Quaternion& turn) {
  std::vector<double> gaps;
  for (const ManifoldPoint& point : manifold) {
    const Vector3 arm = point.p_WC + point.separation * point.n_W - tool.X_WS.p;
    const Vector3 p_W = tool.X_WS.p + d_W + turn * arm;
    const bool of_tool = plane_of(point.tool_feature, point.body_feature) == PlaneOwner::kA;
    const Vector3 n_W = of_tool ? Vector3(turn * point.n_W) : point.n_W;
    if (point.axis >= gaps.size()) {
      gaps.resize(point.axis + 1, std::numeric_limits<double>::infinity());
    }
    gaps[point.axis] = std::min(gaps[point.axis], n_W.dot(p_W - point.p_WC));
  }
  return *std::max_element(gaps.begin(), gaps.end());
}

std::pair<Placed, Placed> random_boxes(Random& random) {
  Placed body{random_shape(3, random), random.pose(0.5)};
  Placed tool{random_shape(3, random), random.pose(0.5)};
  tool.X_WS.p = body.X_WS.p + random.uniform(0.01, 0.12) * random.direction();
  if (random.integer(0, 1) == 0) {  // As in holes and on tables.
    tool.X_WS.R = body.X_WS.R * rotation_from_vector(random.uniform(0, 0.05) * random.direction());
  }
  return {tool, body};
}

double true_separation(const Placed& tool, const Placed& body) {
  return box_separation(std::get<Box>(tool.shape), tool.X_WS, std::get<Box>(body.shape), body.X_WS);
}

}  // namespace

TEST_CASE("Wherever the tool goes within epsilon its axes tell whether boxes are apart",
          "[optimised]") {
  Random random;
  int tried = 0;
  while (tried < 3000) {
    const auto [tool, body] = random_boxes(random);
    const AxesManifold manifold = axes_of(tool, body);
    if (manifold.empty()) continue;
    ++tried;
    const Vector3 d_W = random.uniform(0, kEpsilon) * random.direction();
    Placed moved = tool;
    moved.X_WS.p += d_W;
    const double exact = true_separation(moved, body);
    const double told = gap_after(manifold, tool, d_W, Quaternion::Identity());
    CAPTURE(tried, exact, told);
    // Axes less than 0.1 rad apart are one: that may be off by a tenth of the way.
    const double uncertain = 0.1 * d_W.norm() + 1e-6;
    if (exact > uncertain) CHECK(told > 0);
    if (exact < -uncertain) CHECK(told < 0);
  }
}

TEST_CASE(
    "Contacts on all axes of a pair have identities of their own, and normals of their axis") {
  Random random;
  for (int i = 0; i < 2000; ++i) {
    const auto [tool, body] = random_boxes(random);
    std::set<std::tuple<Feature, Feature, std::uint32_t>> known;
    std::vector<Vector3> normals;
    for (const ManifoldPoint& point : axes_of(tool, body)) {
      CAPTURE(i, point.axis);
      CHECK(known.emplace(point.tool_feature, point.body_feature, point.face).second);
      if (point.axis >= normals.size()) normals.push_back(point.n_W);
      REQUIRE(point.axis < normals.size());
      CHECK((normals[point.axis] - point.n_W).norm() == 0);
    }
  }
}

TEST_CASE("Each near axis of two boxes is one to the forces with an axis that bears",
          "[optimised]") {
  Random random;
  int in_chain = 0;  // Axes nearer to one that does not bear than to any that does.
  for (int i = 0; i < 3000; ++i) {
    const auto boxes = random_boxes(random);
    const Placed& tool = std::get<0>(boxes);
    const Placed& body = std::get<1>(boxes);
    const AxesManifold manifold = axes_of(tool, body);
    const bool full = manifold.size() + kMaxManifoldPoints > kMaxAxesPoints;
    if (manifold.empty() || full) continue;
    const auto are_one = [](const Vector3& a, const Vector3& b) {
      return a.dot(b) > std::cos(kOneAxis) - 1e-12;
    };
    std::vector<Vector3> bearing;
    std::vector<Vector3> others;
    for (std::size_t axis = 0; axis <= manifold.back().axis; ++axis) {
      const Vector3 n = std::ranges::find(manifold, axis, &ManifoldPoint::axis)->n_W;
      const bool bears =
          std::ranges::none_of(bearing, [&](const Vector3& former) { return are_one(n, former); });
      (bears ? bearing : others).push_back(n);
    }
    const auto check = [&](const Vector3& n) {
      const auto half = [&](const Placed& box) {
        return (box.X_WS.R.conjugate() * n).cwiseAbs().dot(std::get<Box>(box.shape).size) / 2;
      };
      const double gap = n.dot(tool.X_WS.p - body.X_WS.p) - half(tool) - half(body);
      if (gap < true_separation(tool, body) - 2 * kEpsilon + 1e-6) return;
      const auto is_one = [&](const Vector3& other) { return are_one(n, other); };
      CAPTURE(i, gap, n.transpose());
      CHECK(std::ranges::any_of(bearing, is_one));
      const auto nearest = [&](const std::vector<Vector3>& axes) {
        double cosine = -1;
        for (const Vector3& axis : axes) cosine = std::max(cosine, n.dot(axis));
        return cosine;
      };
      in_chain += nearest(others) > nearest(bearing);
    };
    for (int a = 0; a < 3; ++a) {
      const Vector3 e = tool.X_WS.R * Vector3::Unit(a);
      for (const double sign : {-1.0, 1.0}) {
        check(sign * e);
        check(sign * (body.X_WS.R * Vector3::Unit(a)));
        for (int b = 0; b < 3; ++b) {
          const Vector3 n = e.cross(body.X_WS.R * Vector3::Unit(b));
          if (n.norm() > 1e-6) check(sign * n.normalized());
        }
      }
    }
  }
  CHECK(in_chain > 100);
}

TEST_CASE("Wherever the tool goes within epsilon its axes tell how deep hulls overlap",
          "[optimised]") {
  constexpr double kNear = 0.005;  // m, epsilon.
  Random random;
  int tried = 0;
  int too_deep = 0;
  int too_shallow = 0;
  while (tried < 1000) {
    const int sizes[] = {4, 8, 16, 32, 64};
    const Hull a = random_hull(sizes[random.integer(0, 4)], random);
    const Hull b = random_hull(sizes[random.integer(0, 3)], random);
    const Placed body{b, random.pose(0.5)};
    const Vector3 p = body.X_WS.p + random.uniform(0.01, 0.12) * random.direction();
    const Placed tool{a, {p, random.rotation()}};
    const AxesManifold manifold = axes_of(tool, body, kNear);
    if (manifold.empty() || manifold.front().separation < -0.02) continue;
    const Vector3 d_W = random.uniform(0, kNear) * random.direction();
    const double exact = hull_separation(a, {p + d_W, tool.X_WS.R}, b, body.X_WS);
    if (exact > 0) continue;
    ++tried;
    const double told = gap_after(manifold, tool, d_W, Quaternion::Identity());
    too_shallow += told > exact + 0.1 * d_W.norm() + 1e-6;  // Axes less than 0.1 rad apart are one.
    too_deep += told < exact - 2e-4;
  }
  // Axes of edges of hulls are not listed, except the best: where the tool goes another may be it.
  CHECK(too_shallow <= 10);  // Of 1000; with seeds 1 to 6 it is 0 to 3.
  CHECK(too_deep < 80);
}

TEST_CASE("The axes of a disc that leans over an edge tell its depth, now and after a small turn",
          "[optimised]") {
  constexpr double kNear = 0.005;  // m, epsilon.
  const Placed block{Box{Vector3(0.2, 0.2, 0.1)},
                     {Vector3(-0.1, 0, -0.05), Quaternion::Identity()}};
  Random random;
  double now = 0;     // Largest error, m.
  double turned = 0;  // The same.
  for (int i = 0; i < 400; ++i) {
    const Cylinder disc{random.uniform(0.02, 0.1), random.uniform(0.002, 0.02)};
    const double lean_to = random.uniform(-3, 3);
    const Vector3 lean = random.uniform(0, 0.6) * Vector3(std::cos(lean_to), std::sin(lean_to), 0);
    Placed tool{disc,
                {Vector3(random.uniform(-1, 1) * disc.radius, random.uniform(-0.05, 0.05), 0.1),
                 rotation_from_vector(lean) * rotation_from_vector({0, 0, random.uniform(-3, 3)})}};
    const DistanceBounds apart = signed_distance(tool, block);
    tool.X_WS.p += (random.uniform(-0.002, 0.001) - apart.lower) * apart.n_W;
    const auto error_after = [&](const Quaternion& turn) {
      const DistanceBounds exact =
          signed_distance({disc, {tool.X_WS.p, turn * tool.X_WS.R}}, block);
      const double told = gap_after(axes_of(tool, block, kNear), tool, Vector3::Zero(), turn);
      return std::max(told - exact.upper, exact.lower - told);
    };
    now = std::max(now, error_after(Quaternion::Identity()));
    turned = std::max(turned, error_after(rotation_from_vector(0.02 * random.direction())));
  }
  CHECK(now < 1e-6);
  // 20 mrad at 0.1 m are 2 mm; with seeds 1 to 5 it is up to 0.5 mm.
  CHECK(turned < 1e-3);
}

TEST_CASE("A peg beside the edge of a block has the axes of its side and its top") {
  const Placed block{Box{Vector3(0.1, 0.1, 0.1)}, Pose{}};
  const Placed peg{Box{Vector3(0.04, 0.04, 0.08)},
                   {Vector3(0.071, 0, 0.093), Quaternion::Identity()}};
  const AxesManifold manifold = axes_of(peg, block);
  const auto least = [&](const Vector3& n) {
    double separation = std::numeric_limits<double>::infinity();
    for (const ManifoldPoint& point : manifold) {
      if (point.n_W.isApprox(n)) separation = std::min(separation, point.separation);
    }
    return separation;
  };
  CHECK(manifold.front().n_W.isApprox(Vector3::UnitZ()));
  CHECK(least(Vector3::UnitX()) == Approx(0.001).margin(1e-9));  // m
  CHECK(least(Vector3::UnitZ()) == Approx(0.003).margin(1e-9));
  CHECK(manifold.size() == 8);
}

TEST_CASE(
    "A sphere at the edge of a block has the axis of nearest points and those of both faces") {
  const Placed block{Box{Vector3(0.1, 0.1, 0.1)}, Pose{}};
  const Placed sphere{Sphere{0.02}, {Vector3(0.066, 0, 0.066), Quaternion::Identity()}};
  const AxesManifold manifold = axes_of(sphere, block);
  REQUIRE(manifold.size() == 3);
  CHECK(manifold[0].n_W.isApprox(Vector3(1, 0, 1).normalized()));
  CHECK(manifold[0].separation == Approx(0.016 * std::sqrt(2.0) - 0.02).margin(1e-9));  // m
  CHECK(manifold[1].separation == Approx(-0.004).margin(1e-9));
  CHECK(manifold[2].separation == Approx(-0.004).margin(1e-9));
}

TEST_CASE("Finding contacts of a pair allocates nothing") {
  Random random;
  ProximityStatistics statistics;
  std::size_t found = 0;
  for (int i = 0; i < 20 * kShapeKinds * kShapeKinds; ++i) {
    const Shape shapes[] = {random_shape(i % kShapeKinds, random),
                            random_shape(i / kShapeKinds % kShapeKinds, random)};
    const Convex tool(shapes[0]);
    const Convex body(shapes[1]);
    const Pose X_WB = random.pose(0.1);
    const Pose X_WT{X_WB.p + 0.04 * random.direction(), random.rotation()};
    const hlm::test::NoMalloc guard;
    found += find_contacts(tool, X_WT, body, X_WB, kEpsilon, statistics).size();
    found += find_axes(tool, X_WT, body, X_WB, kEpsilon, statistics).size();
    CHECK(guard.allocations() == 0);
  }
  CHECK(found > 1000);
}

TEST_CASE("With epsilon 0, and on a half-space, there is the best axis alone") {
  const Placed block{Box{Vector3(0.1, 0.1, 0.1)}, Pose{}};
  const Placed ground{HalfSpace{}, Pose{}};
  const Placed peg{Box{Vector3(0.04, 0.04, 0.08)},
                   {Vector3(0.069, 0, 0.083), Quaternion::Identity()}};
  for (const ManifoldPoint& point : axes_of(peg, block, 0)) CHECK(point.axis == 0);
  for (const ManifoldPoint& point : axes_of(peg, ground, 0.1)) CHECK(point.axis == 0);
  CHECK(axes_of(peg, ground, 0.1).size() == 4);
}

}  // namespace hlm::geometry::test
