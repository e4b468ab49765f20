#include "hlm/geometry/mesh_pieces.h"

#include <algorithm>
#include <cmath>

#include "hlm/geometry/hull.h"
#include "hlm/geometry/index.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/mesh_rays.h"

namespace hlm::geometry {
namespace {

/// Share of the way to the opposite side, where that is nearer: each side's skin ends before the
/// middle.
constexpr double kShare = 0.45;
/// Least depth, m: a piece needs an inside. Sheets thinner than this stick out.
constexpr double kThinnest = 2e-5;
/// A direction at a corner that makes a larger angle with a triangle's normal than 80° (cosine)
/// does not lead behind it.
constexpr double kSteepest = 0.17;

/// Outward unit directions at the points: normals of the triangles around, weighted by angle.
std::vector<Vector3> point_normals(const Mesh& mesh) {
  std::vector<Vector3> normals(mesh.points.size(), Vector3::Zero());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3 n = mesh.area(t).normalized();
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 a = (mesh.corner(t, (i + 1) % 3) - mesh.corner(t, i)).normalized();
      const Vector3 b = (mesh.corner(t, (i + 2) % 3) - mesh.corner(t, i)).normalized();
      normals[at(mesh.triangles[t][i])] += std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * n;
    }
  }
  for (Vector3& n : normals) n.normalize();
  return normals;
}

/// How far the skin may reach from p along the unit vector u, m.
double depth(const MeshRays& rays, const Vector3& p, const Vector3& u) {
  constexpr double kBesideOrigin = 1e-9;
  const double opposite = rays.to_exit(p, u, kBesideOrigin);
  return std::max(kThinnest, std::min(kSkinDepth, kShare * opposite));
}

}  // namespace

bool is_convex(const Mesh& mesh) {
  if (!mesh.closed) return false;
  const HullFaces hull = convex_hull(mesh.points);
  double six = 0;
  for (const auto& loop : hull.loops) {
    for (std::size_t i = 2; i < loop.size(); ++i) {
      const Vector3 a = hull.vertices[loop[0]] - mesh.points[0];
      const Vector3 b = hull.vertices[loop[i - 1]] - mesh.points[0];
      six += a.cross(b).dot(hull.vertices[loop[i]] - mesh.points[0]);
    }
  }
  constexpr double kSame = 1e-4;
  return mesh.volume() > (1 - kSame) * six / 6;
}

std::vector<Hull> skin_of(const Mesh& mesh) {
  const MeshRays rays(mesh);
  const std::vector<Vector3> normals = point_normals(mesh);
  std::vector<Vector3> inner;  // Inner points, in the order of the points.
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    interruption_point();
    inner.push_back(mesh.points[i] - depth(rays, mesh.points[i], -normals[i]) * normals[i]);
  }
  std::vector<Hull> pieces;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    interruption_point();
    const Vector3 n = mesh.area(t).normalized();
    const Vector3 middle = (mesh.corner(t, 0) + mesh.corner(t, 1) + mesh.corner(t, 2)) / 3;
    const double deepest = depth(rays, middle, -n);
    Hull& piece = pieces.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 corner = mesh.corner(t, i);
      Vector3 behind = inner[at(mesh.triangles[t][i])] - corner;
      const double below = -behind.dot(n);
      if (below < kSteepest * behind.norm()) {
        behind = -kThinnest * n;
      } else if (below > deepest) {
        behind *= deepest / below;
      }
      piece.vertices.push_back(corner);
      piece.vertices.push_back(corner + behind);
    }
  }
  return pieces;
}

}  // namespace hlm::geometry
