#include "hlm/geometry/probe.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "hlm/common/contact.h"
#include "hlm/geometry/tolerances.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Work of a distance to a shape with a few sides, and of each side of another one.
constexpr std::uint64_t kDistanceWork = 15;
constexpr std::uint64_t kSideOfHull = 3;
/// Square of a cylinder's or a capsule's distance from its axis at which there is no way out, m².
constexpr double kOnAxis = 1e-24;

/// The point of an ellipsoid that is nearest to x, after Eberly: the root of a convex function.
Vector3 nearest_on_ellipsoid(const Vector3& radii, const Vector3& x) {
  constexpr int kSteps = 24;
  const Vector3 squares = radii.cwiseProduct(radii);
  const Vector3 scaled = radii.cwiseProduct(x.cwiseAbs());
  double t = (scaled - squares).maxCoeff();
  for (int step = 0; step < kSteps; ++step) {
    double f = -1;
    double slope = 0;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double below = t + squares[i];
      if (!(below > 0)) continue;
      const double share = scaled[i] / below;
      f += share * share;
      slope -= 2 * share * share / below;
    }
    if (!(f > 1e-13) || !(slope < 0)) break;
    t -= f / slope;
  }
  Vector3 q = Vector3::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double below = t + squares[i];
    q[i] = below > 0 ? squares[i] * x[i] / below : 0;
  }
  const double size = q.cwiseQuotient(radii).norm();
  return size > 0 ? Vector3(q / size) : Vector3(0, 0, radii.z());
}

}  // namespace

Probe::Probe(const Convex& convex, const Pose& X_SC)
    : convex_(convex), kind_(Kind::kPolytope), R_(X_SC.R.toRotationMatrix()), p_(X_SC.p) {
  if (convex.margin() > 0) {
    kind_ = Kind::kRound;
    half_.z() = convex.is_point() ? 0 : convex.vertices()[1].z();
  } else if (convex.is_cylinder()) {
    kind_ = Kind::kCylinder;
    half_ = {convex.support(Vector3::UnitX()).x(), 0, convex.half_length()};
  } else if (convex.is_ellipsoid()) {
    kind_ = Kind::kEllipsoid;
    for (Eigen::Index i = 0; i < 3; ++i) half_[i] = convex.support(Vector3::Unit(i))[i];
  } else if (convex.is_box()) {
    kind_ = Kind::kBox;
    half_ = convex.vertices()[7];
  }
}

bool Probe::is_along(const Vector3& direction) const noexcept {
  static const double cosine = std::cos(kOneAxis);
  const bool is_long = kind_ == Kind::kCylinder || (kind_ == Kind::kRound && half_core() > 0);
  return is_long && std::abs(R_.col(2).dot(direction)) > cosine;
}

Probe::Distance Probe::distance(const Vector3& p) const noexcept {
  Work::add(kDistanceWork);
  const Vector3 x = local(p);
  switch (kind_) {
    case Kind::kRound: {
      const Vector3 away = x - Vector3(0, 0, std::clamp(x.z(), -half_core(), half_core()));
      const double distance = away.norm();
      if (!(distance > 0)) return {-margin(), R_.col(0)};
      return {distance - margin(), R_ * (away / distance)};
    }
    case Kind::kBox: {
      const Vector3 over = x.cwiseAbs() - half_;
      Eigen::Index most = 0;
      const double highest = over.maxCoeff(&most);
      if (highest <= 0 || (over.array() > 0).count() == 1) {
        return {highest, x[most] < 0 ? Vector3(-R_.col(most)) : Vector3(R_.col(most))};
      }
      Vector3 away = over.cwiseMax(0.0);
      const double distance = away.norm();
      for (Eigen::Index i = 0; i < 3; ++i) away[i] = std::copysign(away[i], x[i]);
      return {distance, R_ * (away / distance)};
    }
    case Kind::kCylinder: {
      const double along = x.head<2>().norm();
      const double beside = along - half_.x();
      const double above = std::abs(x.z()) - half_.z();
      const double up = x.z() < 0 ? -1 : 1;
      const Vector3 aside =
          along * along > kOnAxis ? Vector3(x.x() / along, x.y() / along, 0) : Vector3::UnitX();
      if (beside > 0 && above > 0) {
        const double distance = std::hypot(beside, above);
        return {distance, R_ * ((beside * aside + Vector3(0, 0, up * above)) / distance)};
      }
      if (beside > above) return {beside, R_ * aside};
      return {above, up * R_.col(2)};
    }
    case Kind::kEllipsoid: {
      const Vector3 q = nearest_on_ellipsoid(half_, x);
      const Vector3 out = q.cwiseQuotient(half_.cwiseProduct(half_)).normalized();
      return {out.dot(x - q), R_ * out};
    }
    case Kind::kPolytope:
      break;
  }
  Work::add(kSideOfHull * convex_.face_normals().size());
  double highest = -std::numeric_limits<double>::infinity();
  std::size_t face = 0;
  for (std::size_t i = 0; i < convex_.face_normals().size(); ++i) {
    const double height = convex_.height_over_face(i, x);
    if (height > highest) face = i;
    highest = std::max(highest, height);
  }
  return {highest, R_ * convex_.face_normals()[face]};
}

double Probe::lowest(const Vector3& n) const noexcept {
  const Vector3 x = R_.transpose() * n;
  switch (kind_) {
    case Kind::kRound:
      return n.dot(p_) - half_core() * std::abs(x.z());
    case Kind::kBox:
      return n.dot(p_) - half_.dot(x.cwiseAbs());
    case Kind::kCylinder:
      return n.dot(p_) - half_.z() * std::abs(x.z()) - half_.x() * x.head<2>().norm();
    case Kind::kEllipsoid:
      return n.dot(p_) - half_.cwiseProduct(x).norm();
    case Kind::kPolytope:
      break;
  }
  return n.dot(p_) + x.dot(convex_.support(-x));
}

Probe::Points Probe::lowest_points(const Vector3& n) const noexcept {
  constexpr std::uint64_t kPointsWork = 40;
  Work::add(kPointsWork);
  static const double aligned = std::sin(kOneAxis);
  const Vector3 x = R_.transpose() * n;
  Points points;
  const auto add = [&](const Vector3& p, const Feature& feature) {
    if (points.size() < points.capacity()) points.push_back({p_ + R_ * p, feature});
  };
  const auto vertex = [](std::size_t index) {
    return Feature{FeatureKind::kVertex, 0, static_cast<std::uint16_t>(index)};
  };
  if (kind_ == Kind::kRound) {
    if (half_core() == 0) {
      add(Vector3::Zero(), vertex(0));
      return points;
    }
    const bool both = std::abs(x.z()) <= narrow::kParallelRoundEdges;
    if (both || x.z() > 0) add({0, 0, -half_core()}, vertex(0));
    if (both || x.z() < 0) add({0, 0, half_core()}, vertex(1));
    return points;
  }
  if (kind_ == Kind::kBox) {
    // Along an axis to which n is perpendicular both sides are as low: two of them make a face.
    const Vector3 size = x.cwiseAbs();
    const bool is_face = (size.array() <= aligned).count() == 2 && size.squaredNorm() > 0.5;
    const double least = is_face ? aligned : narrow::kParallelEdges;
    for (std::size_t i = 0; i < 8; ++i) {
      bool low = true;
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const bool is_high = (i >> axis & 1) != 0;
        if (size[axis] > least && is_high != (x[axis] < 0)) low = false;
      }
      if (low) add(convex_.vertices()[i], vertex(i));
    }
    return points;
  }
  static const double cosine = std::cos(kOneAxis);
  if (convex_.has_faces()) {
    const Patch patch = convex_.facing(-x);
    if (patch.is_face() && patch.normal.dot(-x) >= cosine) {
      for (const Patch::Corner& corner : patch.corners) add(corner.p, corner.vertex);
      // A rim's corners stand for it, and its lowest point may be between them.
      if (!convex_.is_cylinder() || 1 - x.z() * x.z() < narrow::kLeans * narrow::kLeans) {
        return points;
      }
    } else {
      const Patch edge = convex_.edge_facing(-x);
      if (edge.corners.size() == 2) {
        const Vector3 along = (edge.corners[1].p - edge.corners[0].p).normalized();
        const double parallel = edge.round ? narrow::kParallelRoundEdges : narrow::kParallelEdges;
        if (std::abs(along.dot(x)) <= parallel) {
          for (const Patch::Corner& corner : edge.corners) add(corner.p, corner.vertex);
          return points;
        }
      }
    }
  }
  const Vector3 p = convex_.support(-x);
  add(p, convex_.feature_at(p));
  return points;
}

Feature Probe::feature_at(const Vector3& p) const noexcept {
  const Vector3 x = local(p);
  if (kind_ == Kind::kRound) {
    if (half_core() == 0) return {FeatureKind::kVertex, 0, 0};
    if (std::abs(x.z()) < half_core() - narrow::kAccuracy) return {FeatureKind::kEdge, 0, 0};
    return {FeatureKind::kVertex, 0, static_cast<std::uint16_t>(x.z() > 0 ? 1 : 0)};
  }
  return convex_.feature_at(x);
}

bool Probe::may_touch(const Vector3& n, double angle, const Vector3& centre,
                      double within) const noexcept {
  const Vector3 x = local(centre);
  const Vector3 m = R_.transpose() * n;
  if (kind_ == Kind::kRound) {
    // The way from the core to the point is along a normal.
    const Vector3 away = x - Vector3(0, 0, std::clamp(x.z(), -half_core(), half_core()));
    const double distance = away.norm();
    if (!(distance > within)) return true;
    const double widest = angle + std::asin(within / distance);
    return widest >= std::numbers::pi || -m.dot(away) >= std::cos(widest) * distance;
  }
  if (angle > 1.2) return true;
  // Where the tool may be lowest along such a normal: in a box of its frame.
  const double turn = std::sin(angle);
  Vector3 middle = Vector3::Zero();
  Vector3 half = half_;
  if (kind_ == Kind::kBox) {
    const bool may_be_face = m.cwiseAbs().maxCoeff() > std::cos(angle + kOneAxis);
    const double flat = may_be_face ? std::sin(angle + kOneAxis) : turn;
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (std::abs(m[i]) <= flat) continue;
      middle[i] = std::copysign(half_[i], -m[i]);
      half[i] = 0;
    }
  } else if (kind_ == Kind::kCylinder) {
    const double radial = m.head<2>().norm();
    half = {half_.x(), half_.x(), half_.z()};
    if (std::abs(m.z()) > turn) {
      middle.z() = std::copysign(half_.z(), -m.z());
      half.z() = 0;
    }
    const double flat = std::sin(angle + kOneAxis);
    if (radial > flat) {
      middle.head<2>() = -half_.x() / radial * m.head<2>();
      half.head<2>().setConstant(half_.x() * std::numbers::sqrt2 * flat / radial);
    }
  } else {
    return true;
  }
  return ((x - middle).cwiseAbs() - half).cwiseMax(0.0).squaredNorm() <= within * within;
}

std::optional<Probe::Range> Probe::over(std::size_t face, const Vector3& a,
                                        const Vector3& b) const noexcept {
  const Vector3 from = local(a);
  const Vector3 along = local(b) - from;
  Range range;
  const auto cut = [&](double at_from, double slope) {  // Where at_from + t slope <= 0.
    if (std::abs(slope) < 1e-15) {
      if (at_from > 0) range.to = -1;
    } else if (slope > 0) {
      range.to = std::min(range.to, -at_from / slope);
    } else {
      range.from = std::max(range.from, -at_from / slope);
    }
  };
  switch (kind_) {
    case Kind::kBox:
      for (Eigen::Index i = 0; i < 3; ++i) {
        if (static_cast<std::size_t>(i) == face / 2) continue;
        cut(from[i] - half_[i], along[i]);
        cut(-from[i] - half_[i], -along[i]);
      }
      break;
    case Kind::kPolytope: {
      Work::add(kSideOfHull * convex_.face_normals().size());
      const Vector3& n = convex_.face_normals()[face];
      for (std::size_t i = 0; i < convex_.face_normals().size(); ++i) {
        const Vector3& m = convex_.face_normals()[i];
        if (i == face || m.dot(n) < -0.9) continue;
        cut(convex_.height_over_face(i, from), m.dot(along));
      }
      break;
    }
    case Kind::kCylinder:
      if (face == kRound) {
        cut(from.z() - half_.z(), along.z());
        cut(-from.z() - half_.z(), -along.z());
      } else {
        const double aa = along.head<2>().squaredNorm();
        const double ab = along.head<2>().dot(from.head<2>());
        const double bb = from.head<2>().squaredNorm() - half_.x() * half_.x();
        const double root = ab * ab - aa * bb;
        if (!(root > 0) || !(aa > 0)) return {};
        range.from = std::max(range.from, (-ab - std::sqrt(root)) / aa);
        range.to = std::min(range.to, (-ab + std::sqrt(root)) / aa);
      }
      break;
    case Kind::kRound:
      cut(from.z() - half_core(), along.z());
      cut(-from.z() - half_core(), -along.z());
      break;
    case Kind::kEllipsoid:
      return {};
  }
  if (!(range.from < range.to)) return {};
  return range;
}

}  // namespace hlm::geometry
