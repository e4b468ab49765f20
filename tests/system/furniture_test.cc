// Furniture as people model it, in one mesh of solids that overlap, and tools that are more than
// one convex shape: server and client together, in virtual time.
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/system/slide.h"

namespace hlm::test {
namespace {

/// OBJ text of solids with corners of their own.
class Solids {
 public:
  /// A prism over a polygon of n corners in the plane z = low (m).
  void add_prism(int n, const Vector3& centre, double radius, double low, double high,
                 double turn) {
    const int first = corners_ + 1;  // OBJ counts from 1.
    for (int i = 0; i < n; ++i) {
      const double angle = turn + 2 * std::numbers::pi * i / n;
      const double x = centre.x() + radius * std::cos(angle);
      const double y = centre.y() + radius * std::sin(angle);
      add_column(x, y, low, high);
    }
    add_faces(first, n);
  }
  void add_box(const Vector3& low, const Vector3& high) {
    const int first = corners_ + 1;
    add_column(low.x(), low.y(), low.z(), high.z());
    add_column(high.x(), low.y(), low.z(), high.z());
    add_column(high.x(), high.y(), low.z(), high.z());
    add_column(low.x(), high.y(), low.z(), high.z());
    add_faces(first, 4);
  }
  std::string text() const { return obj_ + triangles_; }

 private:
  void add_column(double x, double y, double low, double high) {
    obj_ += "v " + numbers({x, y, low}) + "\nv " + numbers({x, y, high}) + '\n';
    corners_ += 2;
  }
  void add_faces(int first, int n) {
    const auto low = [&](int i) { return first + 2 * (i % n); };
    const auto face = [&](int a, int b, int c) {
      triangles_ += fmt::format("f {} {} {}\n", a, b, c);
    };
    for (int i = 0; i < n; ++i) {
      face(low(i), low(i + 1), low(i) + 1);
      face(low(i + 1), low(i + 1) + 1, low(i) + 1);
      if (i == 0 || i == n - 1) continue;
      face(low(0), low(i + 1), low(i));
      face(low(0) + 1, low(i) + 1, low(i + 1) + 1);
    }
  }

  int corners_ = 0;
  std::string obj_;
  std::string triangles_;
};

/// A piece of furniture with its top at z = 0, about (0.1, 0) m, and how wide it is there along y.
struct Furniture {
  std::string name;
  Solids solids;
  double width = 0;       ///< m
  bool is_round = false;  ///< A bar has more or fewer contacts on the way.
};

Furniture random_furniture(Random& random, int kind) {
  Furniture made;
  const double width = made.width = random.uniform(0.08, 0.16);
  const double thickness = random.uniform(0.004, 0.02);
  Solids& solids = made.solids;
  const auto add_legs = [&](double inset, double top) {  // Some end in the top, some below it.
    for (const double x : {-0.05 + inset, 0.25 - inset}) {
      for (const double y : {-width / 2 + inset, width / 2 - inset}) {
        solids.add_box({x - 0.006, y - 0.006, -0.1}, {x + 0.006, y + 0.006, top});
      }
    }
  };
  switch (kind) {
    case 0:
      made.name = "table";
      solids.add_box({-0.05, -width / 2, -thickness}, {0.25, width / 2, 0});
      add_legs(random.uniform(0.006, 0.012), random.integer(0, 1) == 0 ? -thickness : 0);
      break;
    case 1: {
      made.name = "table of planks";
      const int planks = random.integer(2, 5);
      for (int i = 0; i < planks; ++i) {
        const double y = -width / 2 + i * width / planks;
        solids.add_box({-0.05, y, -thickness}, {0.25, y + width / planks, 0});
      }
      add_legs(0.01, -thickness / 2);
      break;
    }
    case 2: {
      made.name = "round stool";
      const int sides = random.integer(8, 32);
      solids.add_prism(sides, {0.1, 0, 0}, 0.12, -thickness, 0, 0);
      for (int i = 0; i < 3; ++i) {
        const double angle = 2 * std::numbers::pi * i / 3;
        solids.add_prism(8, {0.1 + 0.08 * std::cos(angle), 0.08 * std::sin(angle), 0}, 0.008, -0.1,
                         -thickness / 2, 0);
      }
      made.width = 0.24;
      made.is_round = true;
      break;
    }
    case 3:
      made.name = "shelf";
      solids.add_box({-0.05, -width / 2, -thickness}, {0.25, width / 2, 0});
      solids.add_box({-0.05, -width / 2, -0.08 - thickness}, {0.25, width / 2, -0.08});
      for (const double x : {-0.05, 0.24}) {
        solids.add_box({x, -width / 2, -0.1}, {x + 0.01, width / 2, 0});
      }
      break;
    default:
      made.name = "bench with a back";
      solids.add_box({-0.05, -width / 2, -thickness}, {0.25, width / 2, 0});
      solids.add_box({0.25, -width / 2, -0.1}, {0.26, width / 2, 0.1});
      add_legs(0.01, -thickness);
      break;
  }
  return made;
}

TEST_CASE("Twenty pieces of furniture bear a bar that reaches over both edges of them") {
  Random random;
  for (int i = 0; i < 20; ++i) {
    const Furniture furniture = random_furniture(random, i % 5);
    const MeshFloor floor(furniture.solids.text());
    const double length = furniture.width + 2 * random.uniform(0.002, 0.03);
    const Tool bar{"bar on a " + furniture.name,
                   collision("bar", "0 0 0 0 0 0",
                             "<box><size>" + numbers({0.02, length, 0.01}) + "</size></box>"),
                   0.005};
    INFO(i << ": " << bar.name << " of " << length << " m");
    const Vector3 start(0.06, random.uniform(-0.001, 0.001), 0);
    const Slide felt = slide({bar, floor.model(), start, {0.08, 0, 0}});
    CHECK(felt.sideways <= 0.05);                                             // N
    CHECK(felt.tilt <= 0.1);                                                  // degrees
    CHECK(felt.highest - felt.lowest <= (furniture.is_round ? 3e-4 : 5e-5));  // m
    CHECK(felt.missed <= 1e-4);                                               // m
  }
}

/// Boxes, tangents of a circle of that radius in the plane of x and y.
std::string ring(double radius, double thickness) {
  constexpr int kSides = 16;
  const double length = 2 * (radius + thickness / 2) * std::tan(std::numbers::pi / kSides);
  std::string collisions;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSides;
    collisions +=
        collision("ring" + std::to_string(i),
                  numbers({radius * std::cos(angle), radius * std::sin(angle), 0, 0, 0, angle}),
                  "<box><size>" + numbers({thickness, length, thickness}) + "</size></box>");
  }
  return collisions;
}

std::string cylinder(const std::string& name, const std::string& pose, double radius,
                     double length) {
  return collision(
      name, pose,
      fmt::format("<cylinder><radius>{}</radius><length>{}</length></cylinder>", radius, length));
}

const Tool kRing{"ring", ring(0.02, 0.006), 0.003};
const Tool kHook{"hook",
                 box_at("shank", {0, 0, 0.02}, {0.006, 0.006, 0.04}) +
                     box_at("bend", {0.012, 0, 0.003}, {0.03, 0.006, 0.006}) +
                     box_at("tip", {0.024, 0, 0.01}, {0.006, 0.006, 0.02}),
                 0};
const Tool kMug{"mug",
                cylinder("bottom", "0 0 0.002 0 0 0", 0.023, 0.004) + ring(0.02, 0.006) +
                    box_at("handle", {0.034, 0, 0.003}, {0.02, 0.006, 0.006}),
                0.003};
const Tool kBolt{"bolt",
                 cylinder("head", "0 0 0.003 0 0 0", 0.012, 0.006) +
                     cylinder("shank", "0 0 0.021 0 0 0", 0.005, 0.03),
                 0};

/// A floor of bricks in bond, 0.24 m wide.
std::string bricks() {
  std::string collisions;
  for (int row = 0; row < 12; ++row) {
    for (int i = 0; i < 8; ++i) {
      collisions += box_at("brick" + std::to_string(8 * row + i),
                           {0.04 * (i + (row % 2 == 0 ? 0.5 : 0)), 0.02 * (row + 0.5), -0.01},
                           {0.04, 0.02, 0.02});
    }
  }
  return fixed_model("bricks", "0 0 0 0 0 0", collisions);
}

/// The same of hexagons, each of which is a mesh: one model each.
class Hexagons {
 public:
  Hexagons() {
    constexpr double kRadius = 0.02;  // m
    Solids solids;
    solids.add_prism(6, Vector3::Zero(), kRadius, -0.02, 0, std::numbers::pi / 6);
    mesh_ = std::make_unique<MeshFloor>(solids.text());
    const double across = kRadius * std::sqrt(3);
    for (int row = 0; row < 9; ++row) {
      for (int i = 0; i < 8; ++i) {
        models += mesh_->model(
            fmt::format("hexagon{}", 8 * row + i),
            numbers({across * (i + (row % 2 == 0 ? 0.5 : 0)), 1.5 * kRadius * row, 0, 0, 0, 0}));
      }
    }
  }
  std::string models;

 private:
  std::unique_ptr<MeshFloor> mesh_;
};

TEST_CASE("Tools of several shapes slide over bricks, hexagons and planks as over one slab") {
  const Hexagons hexagons;
  Solids table;
  for (const double y : {-0.01, 0.04, 0.09, 0.14}) {
    table.add_box({-0.05, y, -0.02}, {0.3, y + 0.05, 0});
  }
  const MeshFloor planks(table.text());
  const std::string slab =
      fixed_model("slab", "0 0 0 0 0 0", box_at("slab", {0.1, 0.1, -0.01}, {0.5, 0.5, 0.02}));
  const std::array<std::pair<std::string, std::string>, 3> floors{
      {{"bricks", bricks()}, {"hexagons", hexagons.models}, {"planks", planks.model()}}};
  for (const Tool& tool : {kBox, kSphere, kPeg, kCapsule, kRing, kHook, kMug, kBolt}) {
    const auto felt_on = [&](const std::string& floor) {
      return slide({tool, floor, {0.07, 0.08, 0}, {0.1, 0.05, 0}, 0.3});
    };
    const Slide on_slab = felt_on(slab);  // Those whose weight is beside their middle lean there.
    for (const auto& [name, floor] : floors) {
      INFO(tool.name << " on " << name);
      const Slide felt = felt_on(floor);
      CHECK(felt.sideways <= on_slab.sideways + 0.05);          // N
      CHECK(felt.tilt <= on_slab.lean + 0.1);                   // degrees
      CHECK(std::abs(felt.lowest - on_slab.lowest) <= 5e-5);    // m
      CHECK(std::abs(felt.highest - on_slab.highest) <= 5e-5);  // m
      CHECK(felt.missed <= 1e-4);                               // m
    }
  }
}

TEST_CASE("A plate lies flat on bricks and hexagons") {
  const Hexagons hexagons;
  for (const std::string& floor : {bricks(), hexagons.models}) {
    check_smooth(slide({kPlate, floor, {0.12, 0.12, 0}, {0.02, 0.01, 0}}));
  }
}

TEST_CASE("A plate that reaches over the edges of a mesh block on all sides lies flat") {
  Solids solids;
  solids.add_box({-0.05, -0.05, -0.05}, {0.05, 0.05, 0});
  solids.add_box({-0.02, -0.02, -0.1}, {0.02, 0.02, -0.01});  // Else it is convex.
  const MeshFloor block(solids.text());
  check_smooth(slide({kPlate, block.model(), {0.003, -0.002, 0}, {0.01, 0.005, 0}}));
}

}  // namespace
}  // namespace hlm::test
