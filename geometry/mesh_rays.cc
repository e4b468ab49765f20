#include "hlm/geometry/mesh_rays.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace hlm::geometry {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

/// Where the ray enters the box, m; kNever if it misses.
double entry(const Eigen::AlignedBox3d& box, const Vector3& p, const Vector3& inverse) {
  const Vector3 a = (box.min() - p).cwiseProduct(inverse);
  const Vector3 b = (box.max() - p).cwiseProduct(inverse);
  const double in = std::max(0.0, a.cwiseMin(b).maxCoeff());
  return in <= a.cwiseMax(b).minCoeff() ? in : kNever;
}

/// Boxes of the triangles.
std::vector<BoxTree::Box> boxes_of(const Mesh& mesh) {
  std::vector<BoxTree::Box> boxes;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    BoxTree::Box& box = boxes.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) box.extend(mesh.corner(t, i));
    // Flat boxes would be missed by rounding.
    const Vector3 slack = Vector3::Constant(1e-12 + 1e-12 * box.diagonal().norm());
    box.min() -= slack;
    box.max() += slack;
  }
  return boxes;
}

}  // namespace

MeshRays::MeshRays(const Mesh& mesh) : mesh_(mesh), tree_(boxes_of(mesh)) {}

double MeshRays::distance(const Vector3& p, const Vector3& u, double least) const {
  return first(p, u, least, [](std::size_t) { return true; });
}

double MeshRays::to_exit(const Vector3& p, const Vector3& u, double least) const {
  return first(p, u, least, [&](std::size_t triangle) { return mesh_.area(triangle).dot(u) > 0; });
}

template <class Counts>
double MeshRays::first(const Vector3& p, const Vector3& u, double least,
                       const Counts& counts) const {
  const Vector3 inverse = u.unaryExpr([](double c) { return 1 / (c != 0 ? c : 1e-300); });
  double nearest = kNever;
  tree_.visit([&](const BoxTree::Box& box) { return entry(box, p, inverse) < nearest; },
              [&](std::size_t triangle) {
                const double hit = to_triangle(p, u, triangle);
                if (hit > least && hit < nearest && counts(triangle)) nearest = hit;
              });
  return nearest;
}

/// Möller and Trumbore's test; the border counts.
double MeshRays::to_triangle(const Vector3& p, const Vector3& u, std::size_t triangle) const {
  const Vector3 origin = mesh_.corner(triangle, 0);
  const Vector3 e = mesh_.corner(triangle, 1) - origin;
  const Vector3 f = mesh_.corner(triangle, 2) - origin;
  const Vector3 q = u.cross(f);
  const double determinant = e.dot(q);
  if (determinant == 0) return kNever;
  const Vector3 s = (p - origin) / determinant;
  constexpr double kBorder = -1e-9;
  const double a = s.dot(q);
  const double b = u.dot(s.cross(e));
  return a >= kBorder && b >= kBorder && a + b <= 1 - kBorder ? f.dot(s.cross(e)) : kNever;
}

}  // namespace hlm::geometry
