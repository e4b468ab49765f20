// Contacts with solids of triangles: of convex ones those of the same hull, of others where they
// are, and none where nothing touches.
#include "hlm/geometry/solid_contacts.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "hlm/geometry/manifold.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"
#include "tests/support/solid_meshes.h"

namespace hlm::geometry {
namespace {

using test::Random;

constexpr double kEpsilon = 0.002;  // m

Pose at(const Vector3& p) { return {p, Quaternion::Identity()}; }

MeshSolid solid_of(Mesh mesh) {
  std::vector<std::string> said;
  std::vector<MeshSolid> solids = solids_of(repaired(std::move(mesh), "test", said));
  REQUIRE(solids.size() == 1);
  return std::move(solids.front());
}

Convex random_tool(Random& random, int kind) {
  switch (kind) {
    case 0:
      return Convex(Sphere{random.uniform(0.005, 0.03)});
    case 1:
      return Convex(Box{Vector3(0.03, 0.02, 0.05)});
    case 2:
      return Convex(Capsule{0.01, 0.04});
    case 3:
      return Convex(Cylinder{0.015, 0.05});
    case 4:
      return Convex(Ellipsoid{{0.01, 0.02, 0.03}});
    default: {
      Hull hull;
      for (int i = 0; i < 12; ++i) hull.vertices.push_back(0.03 * random.direction());
      return Convex(hull);
    }
  }
}
constexpr std::array kKinds{"sphere", "box", "capsule", "cylinder", "ellipsoid", "hull"};

/// One search, without any before.
SolidContacts found(const Convex& tool, const Pose& X_ST, const MeshSolid& solid,
                    double epsilon = kEpsilon) {
  SolidMemory now;
  return find_solid_contacts(tool, X_ST, solid, epsilon, nullptr, now);
}

const SolidContact& deepest(const SolidContacts& contacts) {
  return *std::ranges::min_element(contacts, {}, &SolidContact::separation);
}

TEST_CASE("A convex solid is touched as far as its hull is, by all kinds of tools", "[optimised]") {
  Random random;
  const Mesh block = test::block({-0.05, -0.04, -0.03}, {0.05, 0.04, 0.03});
  Random smooth;
  const Mesh ball = test::bumpy_ball(10, 0.06, 0, smooth);
  for (const Mesh* mesh : {&block, &ball}) {
    const MeshSolid solid = solid_of(*mesh);
    const Convex hull(Hull{mesh->points});
    for (int kind = 0; kind < 6; ++kind) {
      int same = 0;
      int other = 0;
      double worst = 0;
      for (int i = 0; i < 400; ++i) {
        const Convex tool = random_tool(random, kind);
        // Pushed along a random direction until it overlaps by up to 1 mm.
        Pose X_ST{Vector3::Zero(), random.rotation()};
        const Vector3 out = random.direction();
        ProximityStatistics statistics;
        const double due = random.uniform(-0.001, 0.001);
        double low = 0;
        double high = 0.3;
        for (int step = 0; step < 40; ++step) {
          const double middle = (low + high) / 2;
          X_ST.p = middle * out;
          const Manifold manifold = find_contacts(tool, X_ST, hull, Pose{}, 0.01, statistics);
          double least = 1;
          for (const ManifoldPoint& point : manifold) least = std::min(least, point.separation);
          (least < due ? low : high) = middle;
        }
        const Manifold manifold = find_contacts(tool, X_ST, hull, Pose{}, 0.01, statistics);
        if (manifold.empty()) continue;
        double least = 1;
        for (const ManifoldPoint& point : manifold) least = std::min(least, point.separation);
        const SolidContacts contacts = found(tool, X_ST, solid);
        // Corners before edges meet nothing until they overlap.
        if (contacts.empty()) {
          ++other;
          CHECK(least > 0);
          continue;
        }
        const double difference = std::abs(deepest(contacts).separation - least);
        worst = std::max(worst, difference);
        difference < 2e-5 ? ++same : ++other;
        CHECK(difference < 1e-3);
      }
      INFO(kKinds[static_cast<std::size_t>(kind)] << ": " << same << " as the hull, " << other
                                                  << " not, worst " << 1e3 * worst << " mm");
      CHECK(same > 20 * other);
    }
  }
}

TEST_CASE("A box on a level mesh is held at its corners, whatever the triangles") {
  for (const int cells : {2, 7, 40}) {
    const MeshSolid solid = solid_of(test::wavy_sheet(cells, 0.2 / cells, 0));
    const Convex box(Box{Vector3(0.06, 0.04, 0.02)});
    const Pose X_ST{Vector3(0.0013, 0.0007, 0.00995), rotation_from_vector({0, 0, 0.3})};
    const SolidContacts contacts = found(box, X_ST, solid);
    CHECK(contacts.size() == 4);
    for (const SolidContact& contact : contacts) {
      CHECK(contact.separation == Approx(-5e-5));
      CHECK(contact.n_S.z() == Approx(1));
      CHECK(contact.tool_feature.kind == FeatureKind::kVertex);
    }
  }
}

TEST_CASE("A plate that reaches over a block on all sides is held by the block's corners") {
  const MeshSolid solid = solid_of(test::block({-0.03, -0.02, -0.05}, {0.03, 0.02, 0}));
  const Convex plate(Box{Vector3(0.2, 0.2, 0.01)});
  const SolidContacts contacts =
      found(plate, {{0, 0, 0.0049}, rotation_from_vector({0, 0, 0.2})}, solid);
  CHECK(contacts.size() == 4);
  for (const SolidContact& contact : contacts) {
    CHECK(contact.solid_kind == FeatureKind::kVertex);
    CHECK(contact.separation == Approx(-1e-4));
    CHECK(contact.n_S.z() == Approx(1));
  }
}

TEST_CASE("A bar across a block is held where its edges cross") {
  const MeshSolid solid = solid_of(test::block({-0.03, -0.02, -0.05}, {0.03, 0.02, 0}));
  const Convex bar(Box{Vector3(0.01, 0.2, 0.01)});
  const SolidContacts contacts =
      found(bar, {{0.005, 0, 0.0049}, rotation_from_vector({0, 0, 0.2})}, solid);
  CHECK(contacts.size() == 4);
  for (const SolidContact& contact : contacts) {
    CHECK(contact.solid_kind == FeatureKind::kEdge);
    CHECK(contact.separation == Approx(-1e-4));
    CHECK(contact.n_S.z() == Approx(1));
  }
}

TEST_CASE("Two knife edges that cross are felt where they cross") {
  const MeshSolid solid = solid_of(test::block({-0.03, -0.02, -0.05}, {0.03, 0.02, 0}));
  const Convex box(Box{Vector3(0.02, 0.02, 0.2)});
  // An edge of the box lies along z, and one of the block along x: it is turned about both.
  const Quaternion R = rotation_from_vector({0.7, 0, 0}) * rotation_from_vector({0, 0, 0.785398});
  Random random;
  for (int i = 0; i < 50; ++i) {
    const double gap = random.uniform(-0.0005, 0.001);
    Pose X_ST{Vector3::Zero(), R};
    ProximityStatistics statistics;
    const Convex block(Box{Vector3(0.06, 0.04, 0.05)});
    double low = 0;
    double high = 0.1;
    for (int step = 0; step < 40; ++step) {
      const double middle = (low + high) / 2;
      X_ST.p = Vector3(0.004, 0.02, 0) + middle * Vector3(0, 1, 1);
      double least = 1;
      for (const ManifoldPoint& point :
           find_contacts(box, X_ST, block, at({0, 0, -0.025}), 0.05, statistics)) {
        least = std::min(least, point.separation);
      }
      (least < gap ? low : high) = middle;
    }
    const SolidContacts contacts = found(box, X_ST, solid);
    REQUIRE_FALSE(contacts.empty());
    CHECK(deepest(contacts).separation == Approx(gap).margin(1e-6));
  }
}

/// A slab with a square hole of half width 20 mm through it, from z = -0.05 to 0.
Mesh slab_with_hole() {
  Mesh mesh;
  const auto ring = [&](double half, double z) {
    const auto first = static_cast<int>(mesh.points.size());
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      mesh.points.emplace_back(half * x, half * y, z);
    }
    return first;
  };
  const int top_out = ring(0.1, 0);
  const int top_in = ring(0.02, 0);
  const int low_out = ring(0.1, -0.05);
  const int low_in = ring(0.02, -0.05);
  const auto band = [&](int from, int to) {
    for (int i = 0; i < 4; ++i) {
      const int k = (i + 1) % 4;
      mesh.triangles.push_back({from + i, from + k, to + k});
      mesh.triangles.push_back({from + i, to + k, to + i});
    }
  };
  band(top_out, top_in);
  band(top_in, low_in);
  band(low_in, low_out);
  band(low_out, top_out);
  return mesh;
}

TEST_CASE("A peg in a hole of a mesh touches nothing while it has room, and each wall it meets") {
  const MeshSolid solid = solid_of(slab_with_hole());
  REQUIRE(solid.distance({0, 0, -0.02}) == Approx(0.02));
  const Convex peg(Box{Vector3(0.039, 0.039, 0.06)});
  for (int i = 0; i < 50; ++i) {
    const double z = 0.04 - 0.001 * i;
    for (const SolidContact& contact : found(peg, at({0, 0, z}), solid, 0.001)) {
      CHECK(contact.separation > 0);
    }
    const SolidContacts pressed = found(peg, at({0.0007, 0.0006, z - 0.04}), solid, 0.0);
    bool by_x = false;
    bool by_y = false;
    for (const SolidContact& contact : pressed) {
      CHECK(contact.separation < 0);
      CHECK(contact.separation > -0.00021);
      CHECK(std::abs(contact.n_S.z()) < 1e-6);
      by_x = by_x || contact.n_S.x() < -0.99;
      by_y = by_y || contact.n_S.y() < -0.99;
    }
    CHECK(by_x);
    CHECK(by_y);
  }
}

/// Presses a tool down from above in steps of 0.1 mm, as ticks do, to `depth` below the sheet.
SolidContacts pressed(const Convex& tool, const MeshSolid& sheet, double touching, double depth,
                      const Quaternion& R = Quaternion::Identity()) {
  SolidMemory memory;
  bool is_first = true;
  SolidContacts contacts;
  for (double z = touching + 0.003; z > touching - depth; z -= 1e-4) {
    SolidMemory now;
    contacts = find_solid_contacts(tool, {{0.0013, 0.0017, z}, R}, sheet, 0.0014,
                                   is_first ? nullptr : &memory, now);
    memory = now;
    is_first = false;
    if (z < touching - 1e-4) REQUIRE_FALSE(contacts.empty());
    for (const SolidContact& contact : contacts) CHECK(contact.n_S.z() > 0.5);
    if (z < touching) {
      CHECK(deepest(contacts).separation == Approx(z - touching).margin(1e-3));
    }
  }
  return contacts;
}

TEST_CASE("A sheet is not left on its other side, however thin the tool and deep it is pressed") {
  const MeshSolid level = solid_of(test::wavy_sheet(20, 0.01, 0));
  const MeshSolid wavy = solid_of(test::wavy_sheet(20, 0.01));
  for (const MeshSolid* sheet : {&level, &wavy}) {
    const double at = sheet == &level ? 0 : 0.00005;
    const Convex ball(Sphere{0.002});
    CHECK(deepest(pressed(ball, *sheet, at + 0.002, 0.008)).separation < -0.006);
  }
  const Convex plate(Box{Vector3(0.04, 0.03, 0.0005)});
  CHECK(pressed(plate, level, 0.00025, 0.005).size() == 4);
  CHECK(pressed(plate, level, 0.00025, 0.005, rotation_from_vector({0, 0, 0.5})).size() == 4);
}

TEST_CASE("Where a tool slides over a mesh its overlap does not jump", "[optimised]") {
  Random random;
  for (const int kind : {0, 1, 2, 3, 4}) {
    const Convex tool = random_tool(random, kind);
    const MeshSolid sheet = solid_of(test::wavy_sheet(30, 0.007));
    SolidMemory memory;
    std::optional<double> before;
    int jumps = 0;
    std::string text;
    const Quaternion R = kind == 1 ? rotation_from_vector({0.1, 0.2, 0.3}) : random.rotation();
    // Laid down on the sheet where it begins.
    double z = 0.08;
    for (double x = -0.06; x < 0.06; x += 1e-4) {
      SolidMemory now;
      SolidContacts contacts = find_solid_contacts(tool, {{x, 0.002, z}, R}, sheet, 0.002,
                                                   before ? &memory : nullptr, now);
      for (int step = 0; step < 2000 && (contacts.empty() || deepest(contacts).separation > -3e-4);
           ++step) {
        memory = now;
        z -= 5e-5;
        contacts = find_solid_contacts(tool, {{x, 0.002, z}, R}, sheet, 0.002, &memory, now);
      }
      while (!contacts.empty() && deepest(contacts).separation < -4e-4) {
        memory = now;
        z += 2e-5;
        contacts = find_solid_contacts(tool, {{x, 0.002, z}, R}, sheet, 0.002, &memory, now);
      }
      memory = now;
      CAPTURE(kind, x, z);
      REQUIRE_FALSE(contacts.empty());
      // Slopes are below 0.25: in a step of 0.1 mm the height changes by 0.03 mm.
      if (before && std::abs(z - *before) > 2e-4) {
        ++jumps;
        text += " kind " + std::to_string(kind) + " x " + std::to_string(x) + " z " +
                std::to_string(*before) + " to " + std::to_string(z);
      }
      before = z;
    }
    CAPTURE(text);
    CHECK(jumps == 0);
  }
}

TEST_CASE("A search of a solid allocates nothing") {
  Random random;
  const MeshSolid solid = solid_of(test::bumpy_ball(20, 0.1, 0.1, random));
  for (int kind = 0; kind < 6; ++kind) {
    const Convex tool = random_tool(random, kind);
    SolidMemory memory;
    std::size_t count = 0;
    const test::NoMalloc guard;
    for (int i = 0; i < 100; ++i) {
      SolidMemory now;
      count += find_solid_contacts(tool, {0.11 * random.direction(), random.rotation()}, solid,
                                   kEpsilon, i % 3 == 0 ? nullptr : &memory, now)
                   .size();
      memory = now;
    }
    CHECK(guard.allocations() == 0);
    CHECK(count > 0);
  }
}

}  // namespace
}  // namespace hlm::geometry
