#include "hlm/ve_client/scene/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <type_traits>
#include <variant>
#include <vector>

#include "hlm/geometry/hull.h"

namespace hlm::ve {
namespace {

using std::numbers::pi;

/// What a bounding box has at least along each side, m: a sheet is of something.
constexpr double kLeastSide = 1e-3;

/// A centred body with these mean squares of x, y and z, m².
Solid centred(double volume, const Vector3& squares) {
  const Vector3 diagonal = Vector3::Constant(squares.sum()) - squares;
  return {volume, Vector3::Zero(), (volume * diagonal).asDiagonal()};
}

/// ∫|x|² of points about the origin becomes moments of inertia.
Matrix3 moments_of(const Matrix3& second) { return second.trace() * Matrix3::Identity() - second; }

/// What moves from the centre to a point at the distance r adds, for each m³.
Matrix3 lever(const Vector3& r) { return moments_of(r * r.transpose()); }

Solid box_around(std::span<const Vector3> points) {
  Eigen::AlignedBox3d box;
  for (const Vector3& p : points) box.extend(p);
  const Vector3 sides = box.sizes().cwiseMax(kLeastSide);
  Solid solid = centred(sides.prod(), sides.cwiseAbs2() / 12);
  solid.centre = box.center();
  return solid;
}

/// Adds up the tetrahedra between triangles and one point (Tonon 2004).
class Integral {
 public:
  explicit Integral(const Vector3& origin) : origin_(origin) {}

  void add(const std::array<Vector3, 3>& corners) {
    Matrix3 A;
    for (int i = 0; i < 3; ++i) A.col(i) = corners[static_cast<std::size_t>(i)] - origin_;
    const double six = A.determinant();
    const Vector3 sum = A.rowwise().sum();
    volume_ += six / 6;
    first_ += six / 24 * sum;
    second_ += six / 120 * (sum * sum.transpose() + A * A.transpose());
  }

  /// Empty if it is none of a body that is smaller than its bounding box.
  std::optional<Solid> solid(const Solid& box) const {
    if (!(volume_ > 0) || volume_ > (1 + 1e-6) * box.volume) return std::nullopt;
    const Vector3 centre = first_ / volume_;
    const Matrix3 moments = moments_of(second_) - volume_ * lever(centre);
    const bool is_body = moments.llt().info() == Eigen::Success;
    return is_body ? std::optional(Solid{volume_, origin_ + centre, moments}) : std::nullopt;
  }

 private:
  Vector3 origin_;
  double volume_ = 0;
  Vector3 first_ = Vector3::Zero();
  Matrix3 second_ = Matrix3::Zero();
};

Solid solid_of_hull(const Hull& hull) {
  Solid box = box_around(hull.vertices);
  if (!has_inside(hull.vertices)) return box;
  const HullFaces faces = convex_hull(hull.vertices);
  Integral integral(faces.vertices.front());
  for (const auto& loop : faces.loops) {
    for (std::size_t i = 2; i < loop.size(); ++i) {
      integral.add({faces.vertices[loop[0]], faces.vertices[loop[i - 1]], faces.vertices[loop[i]]});
    }
  }
  return integral.solid(box).value_or(box);
}

Solid solid_of_capsule(const Capsule& capsule) {
  const double r = capsule.radius;
  const double L = capsule.length;
  const double middle = pi * r * r * L;
  const double ends = 4 * pi / 3 * r * r * r;
  // Each half ball has its centre 3/8 of its radius beyond the middle part.
  const double z_ends = r * r / 5 + L * L / 4 + 2 * (L / 2) * (3 * r / 8);
  const double across = (middle * r * r / 4 + ends * r * r / 5) / (middle + ends);
  const double along = (middle * L * L / 12 + ends * z_ends) / (middle + ends);
  return centred(middle + ends, {across, across, along});
}

}  // namespace

std::optional<Solid> solid_of(const Shape& shape) {
  const auto of = [](const auto& each) -> std::optional<Solid> {
    using Each = std::decay_t<decltype(each)>;
    if constexpr (std::is_same_v<Each, Sphere>) {
      const double r = each.radius;
      return centred(4 * pi / 3 * r * r * r, Vector3::Constant(r * r / 5));
    } else if constexpr (std::is_same_v<Each, Capsule>) {
      return solid_of_capsule(each);
    } else if constexpr (std::is_same_v<Each, Cylinder>) {
      const double square = each.radius * each.radius;
      return centred(pi * square * each.length,
                     {square / 4, square / 4, each.length * each.length / 12});
    } else if constexpr (std::is_same_v<Each, Box>) {
      return centred(each.size.prod(), each.size.cwiseAbs2() / 12);
    } else if constexpr (std::is_same_v<Each, Ellipsoid>) {
      return centred(4 * pi / 3 * each.radii.prod(), each.radii.cwiseAbs2() / 5);
    } else if constexpr (std::is_same_v<Each, Hull>) {
      return solid_of_hull(each);
    } else {
      static_assert(std::is_same_v<Each, HalfSpace>);
      return std::nullopt;
    }
  };
  return std::visit(of, shape);
}

Solid solid_of(const Mesh& mesh) {
  Solid box = box_around(mesh.points);
  if (!mesh.closed) return box;
  Integral integral(mesh.points.front());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    integral.add({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
  }
  return integral.solid(box).value_or(box);
}

Solid moved(const Pose& X_AG, const Solid& solid_G) {
  const Matrix3 R = X_AG.R.toRotationMatrix();
  return {solid_G.volume, X_AG * solid_G.centre, R * solid_G.moments * R.transpose()};
}

Solid together(const Solid& a, const Solid& b) {
  const double volume = a.volume + b.volume;
  const Vector3 centre = (a.volume * a.centre + b.volume * b.centre) / volume;
  return {volume, centre,
          a.moments + a.volume * lever(a.centre - centre) + b.moments +
              b.volume * lever(b.centre - centre)};
}

}  // namespace hlm::ve
