// Meshes for tests of solids.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "hlm/geometry/mesh.h"
#include "tests/support/random.h"

namespace hlm::test {

/// A closed ball of 2 n (n - 1) triangles about the origin; `rough`: share of the radius by which
/// its points are moved at random.
inline geometry::Mesh bumpy_ball(int n, double radius, double rough, Random& random) {
  geometry::Mesh mesh;
  mesh.points.emplace_back(0, 0, -radius);
  for (int i = 1; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double latitude = std::numbers::pi * (static_cast<double>(i) / n - 0.5);
      const double longitude = 2 * std::numbers::pi * j / n;
      const Vector3 out(std::cos(latitude) * std::cos(longitude),
                        std::cos(latitude) * std::sin(longitude), std::sin(latitude));
      mesh.points.push_back(radius * (1 + random.uniform(-rough, rough)) * out);
    }
  }
  mesh.points.emplace_back(0, 0, radius);
  const int last = static_cast<int>(mesh.points.size()) - 1;
  const auto at = [&](int i, int j) { return 1 + (i - 1) * n + j % n; };
  for (int j = 0; j < n; ++j) {
    mesh.triangles.push_back({0, at(1, j + 1), at(1, j)});
    for (int i = 1; i + 1 < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
    mesh.triangles.push_back({last, at(n - 1, j), at(n - 1, j + 1)});
  }
  return mesh;
}

/// A block of 12 triangles; its corners are its own. inside_out: its triangles are turned.
inline void add_block(const Vector3& low, const Vector3& high, geometry::Mesh& mesh,
                      bool inside_out = false) {
  const auto first = static_cast<int>(mesh.points.size());
  for (int i = 0; i < 8; ++i) {
    mesh.points.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                             i & 4 ? high.z() : low.z());
  }
  constexpr std::array<std::array<int, 4>, 6> kFaces{
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  for (const auto& [a, b, c, d] : kFaces) {
    for (const auto& [p, q, r] : {std::array{a, b, c}, std::array{a, c, d}}) {
      mesh.triangles.push_back(inside_out ? std::array{first + p, first + r, first + q}
                                          : std::array{first + p, first + q, first + r});
    }
  }
}
inline geometry::Mesh block(const Vector3& low, const Vector3& high) {
  geometry::Mesh mesh;
  add_block(low, high, mesh);
  return mesh;
}

/// An open sheet of 2 n² triangles about the origin, its front up.
inline geometry::Mesh wavy_sheet(int n, double cell, double height = 0.004) {
  geometry::Mesh mesh;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double x = cell * (i - 0.5 * n);
      const double y = cell * (j - 0.5 * n);
      mesh.points.emplace_back(x, y, height * std::sin(60 * x) * std::cos(50 * y));
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j;
      mesh.triangles.push_back({a, a + n + 1, a + n + 2});
      mesh.triangles.push_back({a, a + n + 2, a + 1});
    }
  }
  return mesh;
}

}  // namespace hlm::test
