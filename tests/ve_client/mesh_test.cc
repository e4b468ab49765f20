// Meshes as collision shapes: what is read, repaired and refused; the pieces that stand for them.
#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>

#include <unistd.h>

#include "hlm/geometry/hull.h"
#include "hlm/geometry/manifold.h"
#include "hlm/geometry/mesh_pieces.h"
#include "hlm/geometry/mesh_rays.h"
#include "hlm/ve_client/scene/convex_decomposition.h"
#include "hlm/ve_client/scene/in_child.h"
#include "hlm/ve_client/scene/mesh_file.h"
#include "hlm/ve_client/scene/sdf_loader.h"
#include "hlm/ve_client/scene/tool_assembly.h"
#include "hlm/ve_client/world/world.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/worlds.h"

namespace hlm::ve::test {
namespace {

using Catch::Matchers::ContainsSubstring;
using hlm::test::Random;
namespace fs = std::filesystem;

Mesh tetrahedron() {
  Mesh mesh;
  mesh.points = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  return mesh;
}

Mesh read(const fs::path& file, std::vector<std::string>& said, const Vector3& scale = {1, 1, 1}) {
  return read_mesh({file, "", false, scale}, said);
}

Mesh shipped(const std::string& name) {
  std::vector<std::string> repairs;
  Mesh mesh = read(fs::path(HLM_WORLDS) / "meshes" / name, repairs);
  CHECK(repairs.empty());
  CHECK(mesh.closed);
  return mesh;
}

/// Whether a point is inside, by the rays of three directions; each meets the surface an odd number
/// of times.
bool contains(const Mesh& mesh, const MeshRays& rays, const Vector3& p) {
  (void)mesh;
  int votes = 0;
  for (const Vector3& u :
       {Vector3(0.36, 0.48, 0.8), Vector3(-0.6, 0.0, 0.8), Vector3(0.8, -0.36, -0.48)}) {
    int hits = 0;
    for (double from = 0; std::isfinite(from = rays.distance(p, u, from)); from += 1e-12) ++hits;
    votes += hits % 2;
  }
  return votes >= 2;
}

/// How far the point is outside of the hull's planes, m; negative inside.
double height_over(const HullFaces& hull, const Vector3& p) {
  double highest = -1;
  for (std::size_t i = 0; i < hull.loops.size(); ++i) {
    highest = std::max(highest, hull.normals[i].dot(p - hull.vertices[hull.loops[i][0]]));
  }
  return highest;
}

Vector3 inside_of(const std::vector<Vector3>& corners, Random& random) {
  Vector3 p = Vector3::Zero();
  double sum = 0;
  for (const Vector3& corner : corners) {
    const double weight = -std::log(random.uniform(1e-9, 1));
    p += weight * corner;
    sum += weight;
  }
  return p / sum;
}

double distance_to_triangle(const Vector3& p, const Vector3& a, const Vector3& b,
                            const Vector3& c) {
  const Vector3 n = (b - a).cross(c - a).normalized();
  const auto beside = [&](const Vector3& from, const Vector3& to) {
    return (to - from).cross(p - from).dot(n) >= 0;
  };
  if (beside(a, b) && beside(b, c) && beside(c, a)) return std::abs(n.dot(p - a));
  const auto to_edge = [&](const Vector3& from, const Vector3& to) {
    const double t = (p - from).dot(to - from) / (to - from).squaredNorm();
    return (p - from - std::clamp(t, 0.0, 1.0) * (to - from)).norm();
  };
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

}  // namespace

TEST_CASE("Faults of a mesh are repaired with a word that names it") {
  std::vector<std::string> said;
  const auto only = [&](const std::string& what) {
    REQUIRE(said.size() == 1);
    CHECK_THAT(said[0], ContainsSubstring("mesh thing: ") && ContainsSubstring(what));
    said.clear();
  };
  CHECK(repaired(tetrahedron(), "thing", said).closed);
  CHECK(said.empty());

  Mesh mesh = tetrahedron();
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  CHECK(repaired(mesh, "thing", said).volume() == Approx(1e-3 / 6));
  only("inside out");

  mesh = tetrahedron();
  std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
  CHECK(repaired(mesh, "thing", said).volume() == Approx(1e-3 / 6));
  only("1 triangle turned");

  mesh = tetrahedron();
  mesh.triangles.push_back({0, 1, 1});
  mesh.triangles.push_back({0, 0, 0});
  CHECK(repaired(mesh, "thing", said).closed);
  only("2 triangles without area");

  mesh = tetrahedron();
  mesh.points.emplace_back(-0.1, -0.1, 0);
  mesh.triangles.push_back({0, 1, 4});
  CHECK_FALSE(repaired(mesh, "thing", said).closed);
  only("1 edge with more than two triangles");

  // Corners of their own for each triangle, as STL has them.
  mesh = tetrahedron();
  Mesh loose;
  for (const auto& triangle : mesh.triangles) {
    const auto first = static_cast<int>(loose.points.size());
    for (const int corner : triangle) {
      loose.points.push_back(mesh.points[static_cast<std::size_t>(corner)]);
    }
    loose.triangles.push_back({first, first + 1, first + 2});
  }
  CHECK(repaired(loose, "thing", said).points.size() == 4);
  CHECK(said.empty());
}

TEST_CASE("Meshes that cannot be used are refused in one line that names them") {
  std::vector<std::string> said;
  Mesh mesh = tetrahedron();
  mesh.points[1].x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(repaired(mesh, "thing", said),
                    ContainsSubstring("mesh thing: coordinate nan m"));
  mesh.points[1].x() = 1e6;
  CHECK_THROWS_WITH(repaired(mesh, "thing", said), ContainsSubstring("coordinate 1000000 m must"));
  mesh = tetrahedron();
  mesh.points[3] = mesh.points[2] = mesh.points[1] = mesh.points[0];
  CHECK_THROWS_WITH(repaired(mesh, "thing", said), ContainsSubstring("none of its triangles"));
  mesh = tetrahedron();
  mesh.triangles.resize(1000000, {0, 1, 2});
  CHECK_THROWS_WITH(repaired(mesh, "thing", said),
                    ContainsSubstring("1000000 triangles; at most 50000 are allowed"));
  mesh.triangles.clear();
  CHECK_THROWS_WITH(repaired(mesh, "thing", said), ContainsSubstring("has no triangles"));

  const fs::path file = fs::temp_directory_path() / "haptic_mesh_test.obj";
  CHECK_THROWS_WITH(read("nowhere.obj", said), ContainsSubstring("mesh nowhere.obj: "));
  std::ofstream(file) << "no mesh at all\n";
  CHECK_THROWS_WITH(read(file, said), ContainsSubstring(file.string()));
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv nan 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 9\n";
  CHECK_THROWS_WITH(read(file, said), ContainsSubstring(file.string()));
  fs::remove(file);
  CHECK_THROWS_WITH(
      read_mesh({fs::path(HLM_WORLDS) / "meshes" / "cup.obj", "lid", false, {1, 1, 1}}, said),
      ContainsSubstring("has no submesh 'lid'"));
}

TEST_CASE("Of triangles that lie on each other one stays, and no fan is too wide") {
  std::vector<std::string> said;
  Mesh sheet;
  sheet.points = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 1}};
  CHECK(repaired(sheet, "thing", said).triangles.size() == 1);
  CHECK_THAT(said.at(0), ContainsSubstring("1 triangle left out that other triangles lie on"));

  Mesh fan;
  fan.points = {{0, 0, 0}};
  for (int i = 0; i < 1001; ++i) {
    const double angle = 2 * std::numbers::pi * i / 1001;
    fan.points.emplace_back(std::cos(angle), std::sin(angle), 0);
    fan.triangles.push_back({0, i + 1, (i + 1) % 1001 + 1});
  }
  CHECK_THROWS_WITH(repaired(fan, "thing", said),
                    ContainsSubstring("thing: 1001 triangles meet in one point"));
}

TEST_CASE("A file whose triangles have corners that do not exist is refused") {
  std::vector<std::string> said;
  CHECK_THROWS_WITH(read(fs::path(HLM_TEST_WORLDS) / "meshes/bad_index.ply", said),
                    ContainsSubstring("bad_index.ply"));
}

TEST_CASE("A million triangles are refused by their number, within seconds") {
  constexpr std::uint32_t kCount = 1'000'000;
  const fs::path file = fs::temp_directory_path() / "haptic_million.stl";
  {
    std::ofstream out(file, std::ios::binary);
    const auto put = [&](const auto& value) {
      out.write(reinterpret_cast<const char*>(&value), sizeof value);
    };
    out << std::string(80, ' ');
    put(kCount);
    for (std::uint32_t i = 0; i < kCount; ++i) {
      const auto x = static_cast<float>(i % 1000);
      const auto y = static_cast<float>(i) / 1000;
      const std::array<float, 12> triangle{0, 0, 1, x, y, 0, x + 1, y, 0, x, y + 1, 0};
      put(triangle);
      put(std::uint16_t{0});
    }
  }
  std::vector<std::string> said;
  CHECK_THROWS_WITH(read(file, said), ContainsSubstring("haptic_million.stl: 1000000 triangles") &&
                                          ContainsSubstring("at most 50000"));
  fs::remove(file);
}

TEST_CASE("A file that crashes the library which reads it is refused") {
  std::vector<std::string> said;
  CHECK_THROWS_WITH(read(HLM_TEST_WORLDS "/meshes/loop.dae", said),
                    ContainsSubstring("loop.dae: crashes the library"));
  CHECK(made_in_child([] { return std::string(300'000, '\0'); }).size() == 300'000);
  CHECK(made_in_child([] { return std::string(); }).empty());
  CHECK_THROWS_WITH(made_in_child([]() -> std::string { throw std::runtime_error("why"); }), "why");
  CHECK_THROWS_WITH(made_in_child([]() -> std::string { ::_exit(0); }),
                    ContainsSubstring("crashes"));
  CHECK_THROWS_WITH(made_in_child([]() -> std::string {
                      std::raise(SIGXCPU);
                      return "";
                    }),
                    ContainsSubstring("too long"));
}

TEST_CASE("Two cameras of one name, and two lamps, are no fault of a mesh") {
  std::vector<std::string> said;
  const Mesh mesh = read(HLM_TEST_WORLDS "/meshes/cameras.dae", said);
  CHECK(mesh.closed);
  CHECK(mesh.triangles.size() == 4);
  CHECK(said.empty());
}

TEST_CASE("A scale stretches and mirrors a mesh, and leaves its outside outside") {
  std::vector<std::string> said;
  const fs::path file = fs::path(HLM_WORLDS) / "meshes" / "hook.obj";
  const double volume = read(file, said).volume();
  CHECK(read(file, said, {-2, 1, 3}).volume() == Approx(6 * volume));
  CHECK(said.empty());
}

TEST_CASE("Only meshes that fill their hull are convex") {
  std::vector<std::string> said;
  CHECK(is_convex(repaired(tetrahedron(), "", said)));
  Mesh open = tetrahedron();
  open.triangles.pop_back();
  CHECK_FALSE(is_convex(repaired(open, "", said)));
  for (const char* name : {"cup.obj", "hook.obj", "terrain.obj"})
    CHECK_FALSE(is_convex(shipped(name)));
}

TEST_CASE("The skin of a mesh lies inside of it, and each triangle is a face of its piece") {
  Random random;
  for (const char* name : {"cup.obj", "hook.obj", "terrain.obj"}) {
    const Mesh mesh = shipped(name);
    const MeshRays rays(mesh);
    const std::vector<Hull> skin = skin_of(mesh);
    REQUIRE(skin.size() == mesh.triangles.size());
    int outside = 0;
    int samples = 0;
    for (std::size_t t = 0; t < skin.size(); ++t) {
      const HullFaces hull = convex_hull(skin[t].vertices);
      const Vector3 n = mesh.area(t).normalized();
      CHECK(std::any_of(hull.normals.begin(), hull.normals.end(),
                        [&](const Vector3& face) { return (face - n).norm() < 1e-6; }));
      for (int i = 0; i < 5; ++i) {
        ++samples;
        outside += !contains(mesh, rays, inside_of(skin[t].vertices, random));
      }
    }
    CAPTURE(name, samples);
    CHECK(outside <= samples / 100);
  }
}

TEST_CASE("A sphere over a skin is as far from it as from the nearest triangle") {
  Random random;
  const Mesh mesh = shipped("terrain.obj");
  std::vector<Convex> pieces;
  for (const Hull& hull : skin_of(mesh)) pieces.emplace_back(hull);
  const Convex sphere(Sphere{0.01});
  ProximityStatistics statistics;
  for (int i = 0; i < 100; ++i) {
    const Pose X_WT{
        {random.uniform(-0.12, 0.12), random.uniform(-0.12, 0.12), random.uniform(0.012, 0.025)},
        Quaternion::Identity()};
    double expected = 1;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      expected = std::min(expected, distance_to_triangle(X_WT.p, mesh.corner(t, 0),
                                                         mesh.corner(t, 1), mesh.corner(t, 2)) -
                                        0.01);
    }
    double found = 1;
    for (const Convex& piece : pieces) {
      for (const ManifoldPoint& point : find_contacts(sphere, X_WT, piece, {}, 0.05, statistics)) {
        found = std::min(found, point.separation);
      }
    }
    CHECK(found == Approx(expected).margin(1e-6));
  }
  CHECK(statistics.failures == 0);
}

TEST_CASE("Convex parts cover a concave mesh and leave its hollow open") {
  Random random;
  for (const char* name : {"cup.obj", "hook.obj"}) {
    const Mesh mesh = shipped(name);
    const MeshRays rays(mesh);
    Eigen::AlignedBox3d box;
    for (const Vector3& p : mesh.points) box.extend(p);
    std::vector<HullFaces> parts;
    for (const Hull& hull : decomposed(mesh)) parts.push_back(convex_hull(hull.vertices));
    const auto outside_all = [&](const Vector3& p) {
      double nearest = 1;
      for (const HullFaces& part : parts) nearest = std::min(nearest, height_over(part, p));
      return nearest;
    };
    const double tolerance = 0.02 * box.diagonal().norm();
    double bare = 0;    // Farthest that a point of the surface is from the parts, m.
    double filled = 0;  // Farthest that a part bridges the hollow, m.
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (int i = 0; i < 10; ++i) {
        bare =
            std::max(bare, outside_all(inside_of(
                               {mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)}, random)));
      }
    }
    for (int i = 0; i < 5000; ++i) {
      const Vector3 p =
          box.min() + Vector3(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1))
                          .cwiseProduct(box.sizes());
      if (contains(mesh, rays, p) || outside_all(p) > 0) continue;
      double depth = 1;
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        depth = std::min(depth, distance_to_triangle(p, mesh.corner(t, 0), mesh.corner(t, 1),
                                                     mesh.corner(t, 2)));
      }
      filled = std::max(filled, depth);
    }
    CAPTURE(name, parts.size());
    CHECK(bare < tolerance);
    CHECK(filled < tolerance);
  }
}

TEST_CASE("A mesh of a world file is a skin if it is fixed, and parts if it moves") {
  Diagnostics diagnostics;
  const WorldDescription world = load_world(fs::path(HLM_WORLDS) / "mesh.sdf", diagnostics);
  CHECK(diagnostics.findings().empty());
  const auto& ground = world.bodies.at(0).collisions;
  CHECK(ground.size() == shipped("terrain.obj").triangles.size() + 1);
  CHECK(ground.front().mesh != nullptr);
  CHECK(ground.back().mesh == nullptr);
  const auto& hook = world.bodies.at(1).collisions;
  CHECK(hook.size() > 1);
  for (const CollisionDescription& part : hook) CHECK(part.friction == 0.4);
}

TEST_CASE("A mesh of a world file that is wrong is refused, and one without a shape left out") {
  const fs::path folder = fs::temp_directory_path() / "haptic_mesh_world";
  fs::create_directories(folder);
  const auto load = [&](const std::string& mesh, bool fixed) {
    std::ofstream(folder / "w.sdf")
        << "<sdf version='1.9'><world name='w'><model name='m'><static>"
        << (fixed ? "true" : "false")
        << "</static><link name='l'><collision name='c'><geometry><mesh>" << mesh
        << "</mesh></geometry></collision></link></model></world></sdf>";
    return load_world(folder / "w.sdf");
  };
  const std::string cup = "<uri>" HLM_WORLDS "/meshes/cup.obj</uri>";
  CHECK_THROWS_WITH(load("<uri>none.stl</uri>", true),
                    ContainsSubstring("w.sdf:1: model 'm' link 'l' collision 'c': "
                                      "mesh 'none.stl' is not found; give a path"));
  CHECK_THROWS_WITH(load("<uri>file://" + folder.string() + "</uri>", true),
                    ContainsSubstring("is not a file (" + folder.string() + ")"));
  CHECK_THROWS_WITH(load(cup + "<scale>1 0 1</scale>", true), ContainsSubstring("scale"));
  CHECK_THROWS_WITH(load(cup + "<haptic:pieces>all</haptic:pieces>", true),
                    ContainsSubstring("'all' must be hull, parts or"));
  CHECK_THROWS_WITH(load(cup + "<haptic:pieces>triangles</haptic:pieces>", false),
                    ContainsSubstring("in static models, triangles"));
  CHECK(load(cup + "<haptic:pieces>hull</haptic:pieces>", false).bodies[0].collisions.size() == 1);
  std::ofstream(folder / "flat.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
  CHECK(load("<uri>flat.obj</uri>", true).bodies[0].collisions.size() == 4);
  std::ofstream(folder / "pointer.stl") << "version https://git-lfs.github.com/spec/v1\n";
  for (const std::string none :
       {"flat.obj</uri><haptic:pieces>hull</haptic:pieces>", "pointer.stl</uri>", "w.sdf</uri>"}) {
    CHECK(load("<uri>" + none, true).bodies[0].collisions.empty());
    Diagnostics diagnostics;
    load_world(folder / "w.sdf", diagnostics);
    CHECK_THAT(to_string(diagnostics.findings().front()),
               ContainsSubstring("collision 'c'") && ContainsSubstring("is left out"));
  }
  fs::remove_all(folder);
}

TEST_CASE("The cup of the shipped world stays where it stands, and the pebble in its hollow") {
  const WorldDescription description = hlm::test::repository_world("mesh.sdf");
  World world(description, assemble_tool(description, "hook").bodies);
  for (int i = 0; i < 120; ++i) world.step(1.0 / 60, {});
  CHECK_FALSE(world.fault());
  const auto moved = [&](int body) {
    return (world.X_WB(body).p - description.bodies[static_cast<std::size_t>(body)].X_WB.p).norm();
  };
  CHECK(moved(2) < 0.001);
  CHECK(moved(3) < 0.03);
}

}  // namespace hlm::ve::test
