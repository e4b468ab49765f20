#include "tests/geometry/reference.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "hlm/geometry/hull.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

double extent(const Sphere& s, const Vector3&) { return s.radius; }
double extent(const Capsule& s, const Vector3& n) {
  return s.radius + s.length / 2 * std::abs(n.z());
}
double extent(const Cylinder& s, const Vector3& n) {
  return s.radius * std::hypot(n.x(), n.y()) + s.length / 2 * std::abs(n.z());
}
double extent(const Box& s, const Vector3& n) { return s.size.dot(n.cwiseAbs()) / 2; }
double extent(const Ellipsoid& s, const Vector3& n) { return s.radii.cwiseProduct(n).norm(); }
double extent(const Hull& s, const Vector3& n) {
  double farthest = -std::numeric_limits<double>::infinity();
  for (const Vector3& p : s.vertices) farthest = std::max(farthest, p.dot(n));
  return farthest;
}
double extent(const HalfSpace&, const Vector3& n) {
  return n.z() > 1 - 1e-12 ? 0 : std::numeric_limits<double>::infinity();
}

double depth_outside(const Vector3& q) {
  // q: coordinates beyond each face of a box-like region, negative inside.
  return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
}
double distance(const Sphere& s, const Vector3& p) { return p.norm() - s.radius; }
double distance(const Capsule& s, const Vector3& p) {
  const double z = std::clamp(p.z(), -s.length / 2, s.length / 2);
  return (p - Vector3(0, 0, z)).norm() - s.radius;
}
double distance(const Cylinder& s, const Vector3& p) {
  const double radial = std::hypot(p.x(), p.y()) - s.radius;
  const double axial = std::abs(p.z()) - s.length / 2;
  return std::hypot(std::max(radial, 0.0), std::max(axial, 0.0)) +
         std::min(std::max(radial, axial), 0.0);
}
double distance(const Box& s, const Vector3& p) { return depth_outside(p.cwiseAbs() - s.size / 2); }
double distance(const HalfSpace&, const Vector3& p) { return p.z(); }
double distance(const Ellipsoid& s, const Vector3& p) {
  // The foot is r_i² p_i / (t + r_i²) for the largest t that brings it to the surface (Eberly).
  const Vector3 squares = s.radii.cwiseProduct(s.radii);
  const auto foot = [&](double t) {
    return Vector3(squares.cwiseProduct(p).cwiseQuotient(squares + Vector3::Constant(t)));
  };
  const double nearest = -squares.minCoeff();
  double low = nearest;
  double high = nearest + s.radii.maxCoeff() * (p.norm() + s.radii.maxCoeff());
  for (int i = 0; i < 200; ++i) {
    const double t = (low + high) / 2;
    (foot(t).cwiseQuotient(s.radii).norm() > 1 ? low : high) = t;
  }
  const double sign = p.cwiseQuotient(s.radii).norm() > 1 ? 1 : -1;
  return sign * (p - foot(high)).norm();
}
double distance(const Hull& s, const Vector3& p) {
  // Beside a face it is that from the face's plane.
  const HullFaces hull = convex_hull(s.vertices);
  double highest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hull.loops.size(); ++i) {
    highest = std::max(highest, hull.normals[i].dot(p - hull.vertices[hull.loops[i][0]]));
  }
  return highest;
}

std::array<Vector3, 8> corners(const Box& box, const Pose& X) {
  std::array<Vector3, 8> result;
  for (std::size_t i = 0; i < 8; ++i) {
    const Vector3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    result[i] = X * Vector3(sign.cwiseProduct(box.size) / 2);
  }
  return result;
}

double segment_distance(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  // Alternating projections of the clamped closest points, started from the lines' own.
  const Vector3 u = b - a;
  const Vector3 v = d - c;
  const double uv = u.dot(v);
  const double denominator = u.squaredNorm() * v.squaredNorm() - uv * uv;
  double s = 0.5;
  if (denominator > 1e-12 * u.squaredNorm() * v.squaredNorm()) {
    s = ((c - a).dot(u) * v.squaredNorm() - (c - a).dot(v) * uv) / denominator;
  }
  s = std::clamp(s, 0.0, 1.0);
  double t = 0;
  for (int i = 0; i < 3; ++i) {
    t = std::clamp((a + s * u - c).dot(v) / v.squaredNorm(), 0.0, 1.0);
    s = std::clamp((c + t * v - a).dot(u) / u.squaredNorm(), 0.0, 1.0);
  }
  return (a + s * u - c - t * v).norm();
}

double overlap_gap(const Placed& a, const Placed& b) {
  const Matrix3 A = a.X_WS.R.toRotationMatrix();
  const Matrix3 B = b.X_WS.R.toRotationMatrix();
  double best = -std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector3& n) {
    if (n.norm() < 1e-9) return;
    const Vector3 unit = n.normalized();
    best = std::max({best, gap_along(a, b, unit), gap_along(a, b, -unit)});
  };
  for (int i = 0; i < 3; ++i) {
    consider(A.col(i));
    consider(B.col(i));
    for (int j = 0; j < 3; ++j) consider(A.col(i).cross(B.col(j)));
  }
  return best;
}

}  // namespace

double extent_along(const Placed& placed, const Vector3& n_W) {
  const Vector3 n_S = placed.X_WS.R.conjugate() * n_W;
  return placed.X_WS.p.dot(n_W) +
         std::visit([&](const auto& shape) { return extent(shape, n_S); }, placed.shape);
}

double gap_along(const Placed& tool, const Placed& body, const Vector3& n_W) {
  return -extent_along(tool, -n_W) - extent_along(body, n_W);
}

double largest_gap(const Placed& tool, const Placed& body, const Vector3& n_W, Random& random) {
  Vector3 best_n = n_W;
  double best = gap_along(tool, body, n_W);
  const auto consider = [&](const Vector3& n) {
    const double gap = gap_along(tool, body, n);
    if (gap <= best) return false;
    best = gap;
    best_n = n;
    return true;
  };
  for (int i = 0; i < 200; ++i) consider(random.direction());
  double radius = 0.1;  // rad.
  for (int i = 0; i < 200; ++i) {
    if (!consider((best_n + radius * random.direction()).normalized())) radius *= 0.93;
  }
  return best;
}

double box_separation(const Box& a, const Pose& X_WA, const Box& b, const Pose& X_WB) {
  const Placed placed_a{a, X_WA};
  const Placed placed_b{b, X_WB};
  const double overlap = overlap_gap(placed_a, placed_b);
  if (overlap <= 0) return overlap;
  const auto corners_a = corners(a, X_WA);
  const auto corners_b = corners(b, X_WB);
  double best = std::numeric_limits<double>::infinity();
  for (const Vector3& p : corners_a) best = std::min(best, distance_to_surface(placed_b, p));
  for (const Vector3& p : corners_b) best = std::min(best, distance_to_surface(placed_a, p));
  for (std::size_t i = 0; i < 8; ++i) {
    for (std::size_t bit_a = 1; bit_a < 8; bit_a *= 2) {
      if (i & bit_a) continue;
      for (std::size_t j = 0; j < 8; ++j) {
        for (std::size_t bit_b = 1; bit_b < 8; bit_b *= 2) {
          if (j & bit_b) continue;
          best = std::min(best, segment_distance(corners_a[i], corners_a[i | bit_a], corners_b[j],
                                                 corners_b[j | bit_b]));
        }
      }
    }
  }
  return best;
}

double distance_to_surface(const Placed& placed, const Vector3& p_W) {
  const Vector3 p_S = placed.X_WS.inverse() * p_W;
  return std::visit([&](const auto& shape) { return distance(shape, p_S); }, placed.shape);
}

Shape random_shape(int kind, Random& random) {
  const auto size = [&] { return random.uniform(0.01, 0.1); };
  if (kind == 0) return Sphere{size() / 2};
  if (kind == 1) return Capsule{size() / 2, size()};
  if (kind == 2) return Cylinder{size() / 2, size()};
  if (kind == 4) return Ellipsoid{Vector3(size(), size(), size()) / 2};
  if (kind == 5) return random_hull(random.integer(4, 40), random);
  return Box{Vector3(size(), size(), size())};
}

Hull random_hull(int vertices, Random& random) {
  const Vector3 half(random.uniform(0.005, 0.05), random.uniform(0.005, 0.05),
                     random.uniform(0.005, 0.05));
  Hull hull;
  for (int i = 0; i < vertices; ++i) {
    hull.vertices.emplace_back(half.cwiseProduct(random.direction()));
  }
  return hull;
}

Quaternion random_turn(Turn turn, Random& random) {
  const Quaternion quarter =
      rotation_from_vector(std::numbers::pi / 2 * Vector3::Unit(random.integer(0, 2)));
  switch (turn) {
    case Turn::kAny:
      return random.rotation();
    case Turn::kParallel:
      return quarter;
    case Turn::kNearlyParallel:
      return rotation_from_vector(std::pow(10, random.uniform(-9, -1)) * random.direction()) *
             quarter;
    case Turn::kAboutOneAxis:
      return rotation_from_vector(random.uniform(-3, 3) * Vector3::Unit(random.integer(0, 2)));
  }
  return Quaternion::Identity();
}

double hull_separation(const Hull& a, const Pose& X_WA, const Hull& b, const Pose& X_WB) {
  std::vector<Vector3> differences;
  for (const Vector3& p : a.vertices) {
    for (const Vector3& q : b.vertices) differences.emplace_back(X_WA * p - X_WB * q);
  }
  const HullFaces hull = convex_hull(differences);
  double depth = std::numeric_limits<double>::infinity();
  double distance = depth;
  for (std::size_t i = 0; i < hull.loops.size(); ++i) {
    const auto& loop = hull.loops[i];
    const auto corner = [&](std::size_t k) { return hull.vertices[loop[k % loop.size()]]; };
    const Vector3& n = hull.normals[i];
    depth = std::min(depth, n.dot(corner(0)));
    bool over = true;
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Vector3 along = corner(k + 1) - corner(k);
      const double t = std::clamp(-corner(k).dot(along) / along.squaredNorm(), 0.0, 1.0);
      distance = std::min(distance, (corner(k) + t * along).norm());
      over = over && along.cross(-corner(k)).dot(n) >= 0;
    }
    if (over) distance = std::min(distance, std::abs(n.dot(corner(0))));
  }
  return depth >= 0 ? -depth : distance;
}

Manifold contacts_of(const Placed& tool, const Placed& body, double epsilon,
                     ProximityStatistics& statistics) {
  return find_contacts(Convex(tool.shape), tool.X_WS, Convex(body.shape), body.X_WS, epsilon,
                       statistics);
}

Manifold contacts_of(const Placed& tool, const Placed& body, double epsilon) {
  ProximityStatistics statistics;
  const Manifold manifold = contacts_of(tool, body, epsilon, statistics);
  REQUIRE(statistics.queries == 1);
  REQUIRE(statistics.failures == 0);
  return manifold;
}

double smallest_separation(const Manifold& manifold) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const ManifoldPoint& point : manifold) smallest = std::min(smallest, point.separation);
  return smallest;
}

bool has_unique_keys(const Manifold& manifold) {
  std::set<std::pair<Feature, Feature>> keys;
  for (const ManifoldPoint& point : manifold) keys.insert({point.tool_feature, point.body_feature});
  return keys.size() == manifold.size();
}

}  // namespace hlm::geometry::test
