// Poses near touch with any piece of a world, and a terrain to touch.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "hlm/geometry/pieces.h"
#include "tests/support/random.h"

namespace hlm::test {

/// A point on a piece and a direction out of it there, in the frame of its shape G.
struct SurfacePoint {
  Vector3 p = Vector3::Zero();  ///< m.
  Vector3 n = Vector3::UnitZ();
};

/// Any of a piece; of a plane within 0.3 m of its origin, of the skin of a mesh on a triangle.
inline SurfacePoint point_on(const geometry::Piece& piece, Random& random) {
  constexpr double kOfPlane = 0.3;  // m
  const geometry::Convex& convex = *piece.convex;
  if (convex.is_half_space()) {
    const double x = random.uniform(-kOfPlane, kOfPlane);
    return {.p = Vector3(x, random.uniform(-kOfPlane, kOfPlane), 0)};
  }
  const Vector3 any = random.direction();
  if (!convex.has_faces()) return {convex.support(any) + convex.margin() * any, any};
  const int last = static_cast<int>(convex.face_normals().size()) - 1;
  const auto face = piece.mesh ? piece.front : static_cast<std::size_t>(random.integer(0, last));
  Vector3 p = Vector3::Zero();
  double sum = 0;
  for (const Vector3& vertex : convex.vertices()) {
    const double weight = std::pow(random.uniform(0, 1), 3);  // Some points are near the border.
    p += weight * vertex;
    sum += weight;
  }
  const Vector3& n = convex.face_normals()[face];
  p /= sum;
  return {p - convex.height_over_face(face, p) * n, (n + random.vector(0.2)).normalized()};
}

/// How far a shape at X_WG has to move so that it is `gap` over p_W along n_W, m.
inline Vector3 way_to(const SurfacePoint& at_W, double gap, const geometry::Convex& shape,
                      const Pose& X_WG) {
  const Vector3 n_G = X_WG.R.conjugate() * at_W.n;
  const Vector3 lowest = X_WG * Vector3(shape.support(-n_G) - shape.margin() * n_G);
  return at_W.p + gap * at_W.n - lowest;
}

/// A block with hills of 20 mm, `cells` by `cells` cells of 21 mm, closed by sides and a bottom; or
/// the hills alone.
inline geometry::Mesh terrain(int cells, bool closed = true) {
  constexpr double kCell = 0.021;  // m
  geometry::Mesh mesh;
  const int row = cells + 1;
  const int below = row * row;
  for (int i = 0; i < (closed ? 2 : 1) * below; ++i) {
    const double x = kCell * (i % row - cells / 2);
    const double y = kCell * (i % below / row - cells / 2);
    const double height = 0.02 * std::sin(17 * x) * std::cos(13 * y) + 0.004 * std::sin(90 * x);
    mesh.points.emplace_back(x, y, i < below ? height : -0.1);
  }
  const auto quad = [&](int a, int b, int c, int d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (int i = 0; i < cells * cells; ++i) {
    const int a = i / cells * row + i % cells;
    quad(a, a + 1, a + row + 1, a + row);
    if (closed) quad(below + a, below + a + row, below + a + row + 1, below + a + 1);
  }
  const auto side = [&](int a, int b) { quad(a, below + a, below + b, b); };
  for (int i = 0; i < cells && closed; ++i) {
    side(i + 1, i);
    side(cells * row + i, cells * row + i + 1);
    side(i * row, (i + 1) * row);
    side((i + 1) * row + cells, i * row + cells);
  }
  std::vector<std::string> repairs;
  return geometry::repaired(mesh, "terrain", repairs);
}

}  // namespace hlm::test
