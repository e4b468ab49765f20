// A convex shape as a solid's features see it: how far are they from it, and which way is out of
// it?
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/common/static_vector.h"
#include "hlm/geometry/convex.h"

namespace hlm::geometry {

/// A convex shape that is no half-space, at a pose in a frame S.
class Probe {
 public:
  /// Signed distance of a point, negative inside, and the direction in which it grows, unit.
  struct Distance {
    double value = 0;  ///< m. Of a hull no more than the distance.
    Vector3 out = Vector3::UnitZ();
  };
  /// A point of the core that is lowest along a normal, or about as low.
  struct Point {
    Vector3 p = Vector3::Zero();
    Feature feature;
  };
  using Points = StaticVector<Point, kMaxFaceCorners>;
  /// Part of a segment, from 0 to 1.
  struct Range {
    double from = 0;
    double to = 1;
  };

  Probe(const Convex& convex, const Pose& X_SC);

  const Convex& convex() const noexcept { return convex_; }
  double margin() const noexcept { return convex_.margin(); }
  const Vector3& origin() const noexcept { return p_; }
  /// Whether parts of its surface are planes.
  bool is_flat() const noexcept { return convex_.has_faces(); }
  /// Whether it has a round side that a unit vector runs along.
  bool is_along(const Vector3& direction) const noexcept;

  Distance distance(const Vector3& p) const noexcept;
  /// Whether distance() is exact: of all but hulls.
  bool is_simple() const noexcept { return kind_ != Kind::kPolytope; }
  /// The point of the core that is lowest along n.
  Vector3 outermost(const Vector3& n) const noexcept {
    return p_ + R_ * convex_.support(-(R_.transpose() * n));
  }
  /// Extent of the core along the unit vector n, as n-coordinates, m.
  double lowest(const Vector3& n) const noexcept;
  double highest(const Vector3& n) const noexcept { return -lowest(-n); }
  /// Which points of the core touch a plane with normal n first: the corners of a face or the ends
  /// of an edge that is parallel to it, or one point.
  Points lowest_points(const Vector3& n) const noexcept;
  /// The feature at a point of its surface.
  Feature feature_at(const Vector3& p) const noexcept;
  /// Whether a contact whose normal is within an angle (rad) of n can be on a point that is no
  /// farther than `within` from the centre, m, its separation and the solid's extent included.
  bool may_touch(const Vector3& n, double angle, const Vector3& centre,
                 double within) const noexcept;

  /// Calls `use(height, out, face)` for the sides of the surface: how high p is over each of them.
  template <class Use>
  void for_each_side(const Vector3& p, const Use& use) const;
  /// The part of the segment from a to b that is over a flat side, or along a round one if they are
  /// parallel.
  std::optional<Range> over(std::size_t face, const Vector3& a, const Vector3& b) const noexcept;

  /// Number of the round side of a cylinder or capsule, among the sides.
  static constexpr std::size_t kRound = 1000000;

 private:
  enum class Kind : std::uint8_t { kRound, kBox, kCylinder, kEllipsoid, kPolytope };

  Vector3 local(const Vector3& p) const noexcept { return R_.transpose() * (p - p_); }
  double half_core() const noexcept { return half_.z(); }

  const Convex& convex_;
  Kind kind_;
  Matrix3 R_;
  Vector3 p_;
  Vector3 half_ = Vector3::Zero();  ///< Half a box; half a core's length in z; radii.
};

template <class Use>
void Probe::for_each_side(const Vector3& p, const Use& use) const {
  const Vector3 x = local(p);
  switch (kind_) {
    case Kind::kBox:
      for (int i = 0; i < 3; ++i) {
        use(-x[i] - half_[i], Vector3(-R_.col(i)), static_cast<std::size_t>(2 * i));
        use(x[i] - half_[i], Vector3(R_.col(i)), static_cast<std::size_t>(2 * i + 1));
      }
      return;
    case Kind::kPolytope:
      for (std::size_t i = 0; i < convex_.face_normals().size(); ++i) {
        use(convex_.height_over_face(i, x), Vector3(R_ * convex_.face_normals()[i]), i);
      }
      return;
    case Kind::kCylinder: {
      use(-x.z() - half_.z(), Vector3(-R_.col(2)), std::size_t{0});
      use(x.z() - half_.z(), Vector3(R_.col(2)), std::size_t{1});
      const double away = x.head<2>().norm();
      if (away > 0) {
        const Vector3 out = Vector3(x.x(), x.y(), 0) / away;
        use(away - half_.x(), Vector3(R_ * out), kRound);
      }
      return;
    }
    case Kind::kRound:
    case Kind::kEllipsoid: {
      const Distance d = distance(p);
      use(d.value, d.out, kRound);
      return;
    }
  }
}

}  // namespace hlm::geometry
