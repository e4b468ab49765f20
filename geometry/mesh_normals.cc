#include "hlm/geometry/mesh_normals.h"

#include <algorithm>
#include <cmath>

namespace hlm::geometry {
namespace {

/// A point this near to an edge or a corner is on it, m: what nearest points are exact to.
constexpr double kOn = 1e-6;
/// Angle by which a triangle may rise along a normal, rad: rounding, and single-precision corners.
constexpr double kRise = 1e-3;
/// Triangles that rise less over each other, rad, meet without being predicted: 2°.
constexpr double kBend = 0.035;
double distance_to_edge(const Vector3& p, const Vector3& a, const Vector3& b) {
  const double share = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - a - share * (b - a)).norm();
}

/// Whether `holds(t)` for all triangles at an edge that p is on, and for all at a corner if p is
/// there.
template <class Holds>
bool all_triangles_at(const Mesh& mesh, std::size_t triangle, const Vector3& p,
                      const Holds& holds) {
  for (std::size_t i = 0; i < 3; ++i) {
    const int b = mesh.triangles[triangle][(i + 1) % 3];
    const Vector3 p_a = mesh.corner(triangle, i);
    if (distance_to_edge(p, p_a, mesh.corner(triangle, (i + 1) % 3)) > kOn) continue;
    const bool corner = (p_a - p).norm() <= kOn;
    for (const std::size_t t : mesh.around[static_cast<std::size_t>(mesh.triangles[triangle][i])]) {
      const bool meets = corner || std::ranges::count(mesh.triangles[t], b) > 0;
      if (meets && !holds(t)) return false;
    }
  }
  return true;
}

}  // namespace

std::optional<bool> is_normal(const Mesh& mesh, std::size_t triangle, const Vector3& p,
                              const Vector3& n) {
  const auto lies_below = [&](std::size_t t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 along = mesh.corner(t, i) - p;
      if (n.dot(along) > kOn + kRise * along.norm()) return false;
    }
    return true;
  };
  const double depth = mesh.area(triangle).normalized().dot(mesh.corner(triangle, 0) - p);
  if (depth > kOn) return mesh.closed ? std::optional(false) : std::nullopt;
  return lies_below(triangle) && all_triangles_at(mesh, triangle, p, lies_below);
}

Vector3 pseudonormal(const Mesh& mesh, std::size_t triangle, const Vector3& p) {
  const auto& corners = mesh.triangles[triangle];
  for (std::size_t i = 0; i < 3; ++i) {
    if ((mesh.corner(triangle, i) - p).norm() > kOn) continue;
    Vector3 sum = Vector3::Zero();
    for (const std::size_t t : mesh.around[static_cast<std::size_t>(corners[i])]) {
      const auto at = std::ranges::find(mesh.triangles[t], corners[i]) - mesh.triangles[t].begin();
      const auto next = static_cast<std::size_t>(at);
      const Vector3 a = (mesh.corner(t, (next + 1) % 3) - p).normalized();
      const Vector3 b = (mesh.corner(t, (next + 2) % 3) - p).normalized();
      sum += std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * mesh.area(t).normalized();
    }
    return sum;
  }
  Vector3 sum = mesh.area(triangle).normalized();
  for (std::size_t i = 0; i < 3; ++i) {
    const int to = corners[(i + 1) % 3];
    const Vector3 p_from = mesh.corner(triangle, i);
    if (distance_to_edge(p, p_from, mesh.corner(triangle, (i + 1) % 3)) > kOn) continue;
    for (const std::size_t t : mesh.around[static_cast<std::size_t>(corners[i])]) {
      const bool shares = t != triangle && std::ranges::count(mesh.triangles[t], to) > 0;
      if (shares) sum += mesh.area(t).normalized();
    }
  }
  return sum;
}

bool is_concave(const Mesh& mesh, std::size_t triangle, const Vector3& p, const Vector3& q) {
  const Vector3 n = mesh.area(triangle).normalized();
  const auto rises_under = [&](std::size_t t) {
    bool rises = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 along = mesh.corner(t, i) - p;
      rises = rises || n.dot(along) > kBend * along.norm();
      const Vector3 edge = mesh.corner(t, (i + 1) % 3) - mesh.corner(t, i);
      if (edge.cross(q - mesh.corner(t, i)).dot(mesh.area(t)) < 0) return false;
    }
    return rises;
  };
  const auto falls = [&](std::size_t t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 along = mesh.corner(t, i) - p;
      if (n.dot(along) < -kOn - kRise * along.norm()) return true;
    }
    return false;
  };
  bool over = false;
  const bool none_falls = all_triangles_at(mesh, triangle, p, [&](std::size_t t) {
    over = over || rises_under(t);
    return !falls(t);
  });
  return none_falls && over;
}

}  // namespace hlm::geometry
