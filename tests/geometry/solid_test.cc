// Distances to solids of triangles, against brute force, and how meshes become solids.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "hlm/geometry/mesh_solid.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"
#include "tests/support/solid_meshes.h"

namespace hlm::geometry {
namespace {

using test::Random;

double to_segment(const Vector3& p, const Vector3& a, const Vector3& b) {
  const double share = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - a - share * (b - a)).norm();
}

double to_triangle(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 n = (b - a).cross(c - a).normalized();
  const Vector3 q = p - n.dot(p - a) * n;
  const bool over = n.dot((b - a).cross(q - a)) >= 0 && n.dot((c - b).cross(q - b)) >= 0 &&
                    n.dot((a - c).cross(q - c)) >= 0;
  if (over) return std::abs(n.dot(p - a));
  return std::min({to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a)});
}

double to_all(const Mesh& mesh, const Vector3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    least =
        std::min(least, to_triangle(p, mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)));
  }
  return least;
}

/// How often the surface goes around a point: 1 inside, 0 outside.
double winding_number(const Mesh& mesh, const Vector3& p) {
  double sum = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3 a = mesh.corner(t, 0) - p;
    const Vector3 b = mesh.corner(t, 1) - p;
    const Vector3 c = mesh.corner(t, 2) - p;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)),
                          la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4 * std::numbers::pi);
}

Mesh made(Mesh mesh) {
  std::vector<std::string> said;
  return repaired(std::move(mesh), "test", said);
}

TEST_CASE("Distances to closed meshes are those of all triangles, and negative inside",
          "[optimised]") {
  Random random;
  for (const double rough : {0.0, 0.3}) {
    const Mesh mesh = made(test::bumpy_ball(24, 0.1, rough, random));
    const std::vector<MeshSolid> solids = solids_of(mesh);
    REQUIRE(solids.size() == 1);
    const MeshSolid& solid = solids.front();
    CHECK(solid.is_closed());
    CHECK(solid.triangles().size() == mesh.triangles.size());
    for (int i = 0; i < 2000; ++i) {
      const Vector3 p = random.vector(0.15);
      const double due = to_all(mesh, p);
      const double distance = solid.distance(p);
      CHECK(std::abs(distance) == Approx(due).margin(1e-12));
      if (due > 1e-9) CHECK((distance < 0) == (winding_number(mesh, p) > 0.5));
      const double within = random.uniform(0, 0.1);
      CHECK(solid.nearest(p, within).has_value() == (due <= within));
    }
  }
}

TEST_CASE("A mesh that is inside out has the same solid, and a cavity is hollow") {
  Random random;
  Mesh ball = test::bumpy_ball(12, 0.1, 0, random);
  Mesh inside_out = ball;
  for (auto& t : inside_out.triangles) std::swap(t[1], t[2]);
  CHECK(solids_of(made(inside_out)).front().distance({0, 0, 0}) < -0.09);

  Mesh hollow = ball;
  const auto first = static_cast<int>(hollow.points.size());
  for (const Vector3& p : ball.points) hollow.points.push_back(0.5 * p);
  for (const auto& [a, b, c] : ball.triangles) {
    hollow.triangles.push_back({first + a, first + c, first + b});
  }
  const std::vector<MeshSolid> solids = solids_of(made(hollow));
  REQUIRE(solids.size() == 1);
  CHECK(solids.front().distance({0, 0, 0}) > 0.045);
  CHECK(solids.front().distance({0.075, 0, 0}) < -0.02);
}

TEST_CASE("Parts of a mesh are solids of their own, each outside out") {
  Mesh two = test::block({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1});
  test::add_block({0.05, -0.02, -0.02}, {0.3, 0.02, 0.02}, two, true);
  const std::vector<MeshSolid> solids = solids_of(made(two));
  REQUIRE(solids.size() == 2);
  for (const MeshSolid& solid : solids) CHECK(solid.is_closed());
  CHECK(solids[0].contains({0, 0, 0}));
  CHECK_FALSE(solids[1].contains({0, 0, 0}));
  CHECK(solids[1].contains({0.2, 0, 0}));
}

TEST_CASE("Boxes that share a wall make one closed solid without it") {
  Mesh planks;
  for (int i = 0; i < 4; ++i) {
    test::add_block({0.1 * i, 0, 0}, {0.1 * (i + 1), 0.2, 0.02}, planks);
  }
  const std::vector<MeshSolid> solids = solids_of(made(planks));
  REQUIRE(solids.size() == 1);
  CHECK(solids.front().is_closed());
  for (int i = 0; i < 7; ++i) {
    CHECK(solids.front().distance({0.05 * (i + 1), 0.1, 0.01}) == Approx(-0.01));
  }
}

TEST_CASE("Boxes that touch along edges or walls of other triangles are solids of their own") {
  Mesh boxes;
  for (int i = 0; i < 2; ++i) {
    test::add_block({0.1 * i, 0.2 * i, 0}, {0.1 * (i + 1), 0.2 * (i + 1), 0.02}, boxes);
  }
  Mesh planks;
  for (int i = 0; i < 3; ++i) {
    test::add_block({0.1 * i, 0, 0}, {0.1 * (i + 1), 0.2, 0.02}, planks);
    auto& t = planks.triangles;
    const auto n = t.size();  // The other diagonal of the wall at x = 0.1 i.
    const int a = t[n - 4][0];
    const int b = t[n - 4][1];
    const int c = t[n - 4][2];
    const int d = t[n - 3][2];
    t[n - 4] = {a, b, d};
    t[n - 3] = {b, c, d};
  }
  for (const auto& [mesh, count] : {std::pair{boxes, 2}, {planks, 3}}) {
    const std::vector<MeshSolid> solids = solids_of(made(mesh));
    CHECK(solids.size() == static_cast<std::size_t>(count));
    for (const MeshSolid& solid : solids) CHECK(solid.is_closed());
  }
}

TEST_CASE("An open mesh is a sheet: its distance has no sign, its sides have") {
  const Mesh mesh = made(test::wavy_sheet(20, 0.01));
  const std::vector<MeshSolid> solids = solids_of(mesh);
  REQUIRE(solids.size() == 1);
  CHECK_FALSE(solids.front().is_closed());
  Random random;
  for (int i = 0; i < 500; ++i) {
    const Vector3 p = random.vector(0.1);
    const auto nearest = solids.front().nearest(p, 1);
    REQUIRE(nearest);
    CHECK(nearest->distance == Approx(to_all(mesh, p)).margin(1e-12));
  }
  const auto above = solids.front().nearest({0, 0, 0.05}, 1);
  CHECK(solids.front().pseudonormal(*above).z() > 0);
}

TEST_CASE("Triangles in any disorder make solids whose nearest points are right") {
  Random random;
  for (int round = 0; round < 20; ++round) {
    Mesh soup;
    const int points = random.integer(3, 20);
    for (int i = 0; i < points; ++i) soup.points.push_back(random.vector(0.1));
    for (int i = 0; i < 40; ++i) {
      const int a = random.integer(0, points - 1);
      const int b = random.integer(0, points - 1);
      const int c = random.integer(0, points - 1);
      if (a != b && b != c && c != a) soup.triangles.push_back({a, b, c});
    }
    if (soup.triangles.empty()) continue;
    const Mesh mesh = made(soup);
    const std::vector<MeshSolid> solids = solids_of(mesh);
    std::size_t count = 0;
    for (const MeshSolid& solid : solids) count += solid.triangles().size();
    CHECK(count <= mesh.triangles.size());
    if (count < mesh.triangles.size()) continue;  // Walls inside of a solid were left out.
    for (int i = 0; i < 50; ++i) {
      const Vector3 p = random.vector(0.2);
      double least = std::numeric_limits<double>::infinity();
      for (const MeshSolid& solid : solids) {
        if (const auto nearest = solid.nearest(p, 1)) least = std::min(least, nearest->distance);
      }
      CHECK(least == Approx(to_all(mesh, p)).margin(1e-12));
    }
  }
}

TEST_CASE("A way is clear that meets no triangle") {
  const std::vector<MeshSolid> solids = solids_of(made(test::block({0, 0, 0}, {1, 1, 1})));
  const MeshSolid& block = solids.front();
  CHECK(block.is_clear({0.3, 0.4, 0.5}, Vector3::UnitX(), 0.6));
  CHECK_FALSE(block.is_clear({0.3, 0.4, 0.5}, Vector3::UnitX(), 0.8));
  CHECK(block.is_clear({0.3, 0.4, 0.5}, Vector3::UnitX(), 0.7));  // Its end is on one.
  CHECK(block.is_clear({0.3, 0.4, 1}, Vector3::UnitZ(), 5));      // Its start is.
  CHECK_FALSE(block.is_clear({0.3, 0.4, 2}, -Vector3::UnitZ(), 5));
}

TEST_CASE("What is asked of a solid allocates nothing") {
  Random random;
  const std::vector<MeshSolid> solids = solids_of(made(test::bumpy_ball(16, 0.1, 0.2, random)));
  const test::NoMalloc guard;
  double sum = 0;
  for (int i = 0; i < 100; ++i) {
    const Vector3 p = random.vector(0.2);
    sum += solids.front().distance(p);
    sum += solids.front().is_clear(p, random.direction(), 0.1) ? 1 : 0;
  }
  CHECK(guard.allocations() == 0);
  CHECK(std::isfinite(sum));
}

}  // namespace
}  // namespace hlm::geometry
