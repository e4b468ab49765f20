#include "hlm/geometry/mesh_rays.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace hlm::geometry {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeaf = 4;

/// Where the ray enters the box, m; kNever if it misses.
double entry(const Eigen::AlignedBox3d& box, const Vector3& p, const Vector3& inverse) {
  const Vector3 a = (box.min() - p).cwiseProduct(inverse);
  const Vector3 b = (box.max() - p).cwiseProduct(inverse);
  const double in = std::max(0.0, a.cwiseMin(b).maxCoeff());
  return in <= a.cwiseMax(b).minCoeff() ? in : kNever;
}

}  // namespace

MeshRays::MeshRays(const Mesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  build(0, order_.size());
}

std::size_t MeshRays::build(std::size_t first, std::size_t count) {
  const std::size_t index = nodes_.size();
  Node node;
  node.first = first;
  node.count = count;
  for (std::size_t i = first; i < first + count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) node.box.extend(mesh_.corner(order_[i], k));
  }
  // Flat boxes would be missed by rounding.
  const Vector3 slack = Vector3::Constant(1e-12 + 1e-12 * node.box.diagonal().norm());
  node.box.min() -= slack;
  node.box.max() += slack;
  nodes_.push_back(node);
  if (count <= kLeaf) return index;
  Eigen::Index axis = 0;
  node.box.sizes().maxCoeff(&axis);
  const std::size_t half = count / 2;
  const auto begin = order_.begin() + static_cast<std::ptrdiff_t>(first);
  const auto center = [&](std::size_t t) {
    return mesh_.corner(t, 0)[axis] + mesh_.corner(t, 1)[axis] + mesh_.corner(t, 2)[axis];
  };
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half),
                   begin + static_cast<std::ptrdiff_t>(count),
                   [&](std::size_t a, std::size_t b) { return center(a) < center(b); });
  build(first, half);
  const std::size_t right = build(first + half, count - half);
  nodes_[index].right = right;
  return index;
}

double MeshRays::distance(const Vector3& p, const Vector3& u, double least) const {
  const Vector3 inverse = u.unaryExpr([](double c) { return 1 / (c != 0 ? c : 1e-300); });
  double nearest = kNever;
  std::vector<std::size_t> open{0};
  while (!open.empty()) {
    const std::size_t index = open.back();
    open.pop_back();
    const Node& node = nodes_[index];
    if (entry(node.box, p, inverse) >= nearest) continue;
    if (node.right != 0) {
      open.push_back(index + 1);
      open.push_back(node.right);
      continue;
    }
    for (std::size_t i = node.first; i < node.first + node.count; ++i) {
      const double hit = to_triangle(p, u, order_[i]);
      if (hit > least && hit < nearest) nearest = hit;
    }
  }
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
