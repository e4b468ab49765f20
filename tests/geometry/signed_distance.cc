#include "tests/geometry/signed_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <variant>
#include <vector>

#include <Eigen/Dense>

namespace hlm::geometry::test {
namespace {

constexpr double kWidth = 1e-7;      // m: between the bounds, at the end.
constexpr double kInside = 1e-9;     // m: as near to the origin is as good as around it.
constexpr double kApart = 1e-3;      // m: shapes that nearly touch are compared this far apart.
constexpr int kMaxSteps = 1000;      // Of Wolfe's search: 10 to 60 are usual.
constexpr int kMaxSplits = 200'000;  // Of the branch and bound: some hundreds are usual.

/// What is left of a shape without the sphere that sweeps it.
Vector3 core_support(const Sphere&, const Vector3&) { return Vector3::Zero(); }
Vector3 core_support(const Capsule& s, const Vector3& n) {
  return {0, 0, std::copysign(s.length / 2, n.z())};
}
Vector3 core_support(const Cylinder& s, const Vector3& n) {
  const double radial = std::hypot(n.x(), n.y());
  const double scale = radial > 0 ? s.radius / radial : 0;
  return {scale * n.x(), scale * n.y(), std::copysign(s.length / 2, n.z())};
}
Vector3 core_support(const Box& s, const Vector3& n) {
  return {std::copysign(s.size.x() / 2, n.x()), std::copysign(s.size.y() / 2, n.y()),
          std::copysign(s.size.z() / 2, n.z())};
}
Vector3 core_support(const Ellipsoid& s, const Vector3& n) {
  const Vector3 scaled = s.radii.cwiseProduct(n);
  return s.radii.cwiseProduct(scaled) / scaled.norm();
}
Vector3 core_support(const Hull& s, const Vector3& n) {
  return *std::max_element(s.vertices.begin(), s.vertices.end(),
                           [&](const Vector3& a, const Vector3& b) { return a.dot(n) < b.dot(n); });
}
Vector3 core_support(const HalfSpace&, const Vector3&) { return Vector3::Zero(); }

double swept_radius(const Shape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const auto* capsule = std::get_if<Capsule>(&shape)) return capsule->radius;
  return 0;
}

/// All points of the tool's core minus all of the body's, which may be moved along a vector.
class Difference {
 public:
  Difference(const Placed& tool, const Placed& body)
      : tool_(tool), body_(body), R_WT_(tool.X_WS.R), R_WB_(body.X_WS.R) {}

  Vector3 support(const Vector3& u) const {
    return move_ + farthest(tool_, R_WT_, u) - farthest(body_, R_WB_, -u);
  }
  /// The gap along the unit normal n, m.
  double gap(const Vector3& n) const { return n.dot(support(-n)); }

  Difference moved(const Vector3& by) const {
    Difference result = *this;
    result.move_ += by;
    return result;
  }

 private:
  static Vector3 farthest(const Placed& placed, const Matrix3& R, const Vector3& u) {
    const Vector3 u_S = R.transpose() * u;
    return placed.X_WS.p +
           R * std::visit([&](const auto& shape) { return core_support(shape, u_S); },
                          placed.shape);
  }

  const Placed& tool_;
  const Placed& body_;
  Matrix3 R_WT_;
  Matrix3 R_WB_;
  Vector3 move_ = Vector3::Zero();
};

/// The weights of the points of the affine hull of `points` nearest the origin.
Eigen::VectorXd foot_weights(const std::vector<Vector3>& points) {
  const auto rest = static_cast<Eigen::Index>(points.size()) - 1;
  Eigen::MatrixXd along(3, rest);
  for (Eigen::Index i = 0; i < rest; ++i) {
    along.col(i) = points[static_cast<std::size_t>(i) + 1] - points[0];
  }
  Eigen::VectorXd weights(rest + 1);
  if (rest > 0) weights.tail(rest) = along.completeOrthogonalDecomposition().solve(-points[0]);
  weights[0] = 1 - weights.tail(rest).sum();
  return weights;
}

/// The point of the difference nearest the origin, as far as rounding allows.
Vector3 least_norm_point(const Difference& difference) {
  std::vector<Vector3> corral = {difference.support(Vector3::UnitX())};
  std::vector<double> weights = {1};
  Vector3 x = corral[0];
  for (int step = 0; step < kMaxSteps; ++step) {
    const double norm = x.norm();
    if (norm < kInside) break;
    const Vector3 w = difference.support(-x);
    if (norm - w.dot(x) / norm < 1e-13) break;
    const bool known = std::any_of(corral.begin(), corral.end(),
                                   [&](const Vector3& p) { return (p - w).norm() < 1e-15; });
    if (known) break;
    corral.push_back(w);
    weights.push_back(0);
    for (;;) {
      const Eigen::VectorXd foot = foot_weights(corral);
      double share = 1;
      std::size_t leaves = corral.size();
      for (std::size_t i = 0; i < corral.size(); ++i) {
        const double to = foot[static_cast<Eigen::Index>(i)];
        if (to > 0 || weights[i] <= to) continue;
        const double until = weights[i] / (weights[i] - to);
        if (until < share || leaves == corral.size()) {
          share = std::min(share, until);
          leaves = i;
        }
      }
      for (std::size_t i = 0; i < corral.size(); ++i) {
        weights[i] += share * (foot[static_cast<Eigen::Index>(i)] - weights[i]);
      }
      if (leaves == corral.size()) break;
      corral.erase(corral.begin() + static_cast<std::ptrdiff_t>(leaves));
      weights.erase(weights.begin() + static_cast<std::ptrdiff_t>(leaves));
    }
    Vector3 nearer = Vector3::Zero();
    for (std::size_t i = 0; i < corral.size(); ++i) nearer += weights[i] * corral[i];
    if (!(nearer.norm() < norm)) break;
    x = nearer;
  }
  return x;
}

/// Part of the sphere of directions, between three of them, with the farthest points of the
/// difference there.
struct Sector {
  std::array<Vector3, 3> u;
  std::array<Vector3, 3> p;
  double lower = 0;  ///< No direction in it has less extent, m.
};

/// Any mean of the three points bounds the extent from below by its least over the corners: the
/// extent is convex, so that it is least on the flat triangle where a game of 3 by 3 has its value.
double lower_bound(const Sector& sector) {
  Matrix3 P;  // p_i·u_j
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      P(i, j) = sector.p[static_cast<std::size_t>(i)].dot(sector.u[static_cast<std::size_t>(j)]);
    }
  }
  double best = -std::numeric_limits<double>::infinity();
  const auto mean = [&](const Vector3& share) {
    best = std::max(best, (P.transpose() * share).minCoeff());
  };
  for (int i = 0; i < 3; ++i) mean(Vector3::Unit(i));
  mean(Vector3::Constant(1.0 / 3));
  for (int i = 0; i < 3; ++i) {
    for (const double t : {0.25, 0.5, 0.75}) {
      mean(t * Vector3::Unit(i) + (1 - t) * Vector3::Unit((i + 1) % 3));
    }
  }
  const Vector3 balanced = P.transpose().fullPivLu().solve(Vector3::Ones());
  if (balanced.allFinite() && balanced.minCoeff() >= 0 && balanced.sum() > 0) {
    mean(balanced / balanced.sum());
  }
  return best > 0 ? best : 2 * best;  // The chord of a sector is longer than a half.
}

/// Minus the least extent of the difference, which contains the origin.
DistanceBounds depth(const Difference& difference) {
  const auto less = [](const Sector& a, const Sector& b) { return a.lower > b.lower; };
  std::priority_queue<Sector, std::vector<Sector>, decltype(less)> sectors(less);
  double least = std::numeric_limits<double>::infinity();
  Vector3 best = Vector3::UnitZ();
  const auto add = [&](const Vector3& a, const Vector3& b, const Vector3& c) {
    Sector sector{{a, b, c}, {}};
    for (std::size_t i = 0; i < 3; ++i) {
      sector.p[i] = difference.support(sector.u[i]);
      const double extent = sector.p[i].dot(sector.u[i]);
      if (extent < least) {
        least = extent;
        best = sector.u[i];
      }
    }
    sector.lower = lower_bound(sector);
    if (sector.lower < least - kWidth) sectors.push(sector);
  };
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      for (const double z : {-1.0, 1.0}) {
        add(x * Vector3::UnitX(), y * Vector3::UnitY(), z * Vector3::UnitZ());
      }
    }
  }
  double lower = least - kWidth;
  for (int split = 0; !sectors.empty(); ++split) {
    const Sector s = sectors.top();
    lower = std::min(s.lower, least - kWidth);
    if (s.lower >= least - kWidth || split == kMaxSplits) break;
    sectors.pop();
    const Vector3 ab = (s.u[0] + s.u[1]).normalized();
    const Vector3 bc = (s.u[1] + s.u[2]).normalized();
    const Vector3 ca = (s.u[2] + s.u[0]).normalized();
    add(s.u[0], ab, ca);
    add(ab, s.u[1], bc);
    add(ca, bc, s.u[2]);
    add(ab, bc, ca);
  }
  return {-least, -lower, -best};
}

DistanceBounds core_distance(const Difference& difference) {
  const Vector3 x = least_norm_point(difference);
  if (x.norm() < kInside) return depth(difference);
  DistanceBounds bounds{difference.gap(x.normalized()), x.norm(), x.normalized()};
  if (bounds.width() > kWidth) {  // Rounding: what nearly touches is moved apart along n.
    const Vector3 move = kApart * bounds.n_W;
    const Vector3 y = least_norm_point(difference.moved(move));
    const double gap = difference.gap(y.normalized());
    if (gap > bounds.lower) bounds = {gap, bounds.upper, y.normalized()};
    bounds.upper = std::min(bounds.upper, (y - move).norm());
  }
  return bounds.lower > 0 || bounds.width() <= kWidth ? bounds : depth(difference);
}

}  // namespace

DistanceBounds signed_distance(const Placed& tool, const Placed& body) {
  const double margins = swept_radius(tool.shape) + swept_radius(body.shape);
  DistanceBounds bounds;
  if (std::holds_alternative<HalfSpace>(body.shape)) {
    const Vector3 n = body.X_WS.R * Vector3::UnitZ();
    const double gap = gap_along(tool, body, n);
    return {gap, gap, n};
  }
  bounds = core_distance(Difference(tool, body));
  bounds.lower -= margins;
  bounds.upper -= margins;
  return bounds;
}

}  // namespace hlm::geometry::test
