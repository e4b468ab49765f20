// Worlds of several pieces whose surfaces go on in each other, felt by the hand: server and client
// together, in virtual time.
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/system/slide.h"

namespace hlm::test {
namespace {

/// A floor at z = 0 of 20 tiles along x, with a gap between them (m), each second one higher by
/// `step` (m). As one body, or as a body each.
std::string tiled_floor(double step, double gap, bool one_body = true) {
  std::string collisions;
  std::string models;
  for (int i = 0; i < kTiles; ++i) {
    const std::string name = "tile" + std::to_string(i);
    const Vector3 p(kTile * (i + 0.5), 0, (i % 2 == 0 ? 0 : step) - 0.01);
    const std::string tile = box_at(name, p, {kTile - gap, 0.1, 0.02});
    collisions += tile;
    models += fixed_model(name, "0 0 0 0 0 0", tile);
  }
  return one_body ? fixed_model("floor", "0 0 0 0 0 0", collisions) : models;
}

/// The same of 12 × 12 tiles, of three heights.
std::string tiled_square(double step, double gap) {
  std::string collisions;
  for (int i = 0; i < 12; ++i) {
    for (int j = 0; j < 12; ++j) {
      const double top = step * ((i + 2 * j) % 3);
      collisions += box_at("tile" + std::to_string(12 * i + j),
                           {kTile * (i + 0.5), kTile * (j + 0.5), top - 0.01},
                           {kTile - gap, kTile - gap, 0.02});
    }
  }
  return fixed_model("floor", "0 0 0 0 0 0", collisions);
}

/// OBJ text of a flat sheet at z = 0: two triangles for each square of a tile's length.
std::string sheet_of_triangles() {
  constexpr int kRows = 6;
  std::string obj;
  for (int i = 0; i <= kTiles; ++i) {
    for (int j = 0; j <= kRows; ++j) {
      obj += "v " + numbers({kTile * i, kTile * (j - kRows / 2), 0}) + '\n';
    }
  }
  for (int i = 0; i < kTiles; ++i) {
    for (int j = 0; j < kRows; ++j) {
      const int a = (kRows + 1) * i + j + 1;  // OBJ counts from 1.
      const int b = a + kRows + 1;
      for (const auto& [second, third] : {std::pair{b, b + 1}, {b + 1, a + 1}}) {
        obj += "f " + std::to_string(a) + ' ' + std::to_string(second) + ' ' +
               std::to_string(third) + '\n';
      }
    }
  }
  return obj;
}

/// The same of a flat disk whose triangles meet in its middle, at x = 0.2 m.
std::string fan_of_triangles(int count) {
  std::string obj = "v 0.2 0 0\n";
  std::string triangles;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    obj += "v " + numbers({0.2 + 0.2 * std::cos(angle), 0.2 * std::sin(angle), 0}) + '\n';
    triangles += "f 1 " + std::to_string(i + 2) + ' ' + std::to_string((i + 1) % count + 2) + '\n';
  }
  return obj + triangles;
}

/// count × count feet under a square of 0.168 m, 1 mm apart.
std::string feet(int count) {
  std::string collisions;
  const double pitch = 0.168 / count;
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      collisions += box_at("foot" + std::to_string(count * i + j),
                           {(i + 0.5) * pitch - 0.084, (j + 0.5) * pitch - 0.084, -0.01},
                           {pitch - 0.001, pitch - 0.001, 0.02});
    }
  }
  return fixed_model("feet", "0 0 0 0 0 0", collisions);
}

constexpr double kStep = 1e-5;  // m
constexpr double kGap = 1e-4;   // m

TEST_CASE("A tool slides over 20 tiles with steps and gaps as over one slab") {
  for (const Tool& tool : {kBox, kSphere, kPeg, kCapsule}) {
    check_smooth(slide({tool, tiled_floor(0, 0)}));
    check_smooth(slide({tool, tiled_floor(kStep, kGap)}));
  }
}

TEST_CASE("So it does where each tile is a body of its own") {
  check_smooth(slide({kBox, tiled_floor(kStep, kGap, false)}));
}

TEST_CASE("A tool slides over a flat sheet of triangles as over one slab") {
  const MeshFloor sheet(sheet_of_triangles());
  for (const Tool& tool : {kBox, kSphere, kPeg, kCapsule}) {
    check_smooth(slide({tool, sheet.model()}));
  }
}

TEST_CASE("A tool slides over the middle of a fan of 24 triangles as over one slab") {
  const MeshFloor fan(fan_of_triangles(24));
  for (const Tool& tool : {kBox, kSphere, kPeg, kCapsule}) {
    check_smooth(slide({tool, fan.model(), {0.1, 0.0003, 0}, {0.2, 0, 0}}));
  }
}

TEST_CASE("Over 20 seams a sphere sinks as far as its push presses it in: f/k") {
  const Slide felt = slide({kSphere, tiled_floor(0, kGap)});
  CHECK(felt.lowest >= -1.0 / 4000);  // m
}

TEST_CASE("A tool that turns on its way across a tiled square slides as on one slab") {
  for (const Tool& tool : {kBox, kCapsule}) {
    check_smooth(slide({tool, tiled_square(kStep / 2, kGap), {0.05, 0.06, 0}, {0.12, 0.1, 0}, 1}));
  }
}

TEST_CASE("Seams keep the friction anchor: a box feels its friction and no more") {
  Task task{kBox, tiled_square(0, kGap), {0.05, 0.06, 0}, {0.12, 0.1, 0}};
  task.friction = 0.3;
  const Slide felt = slide(task);
  CHECK(felt.sideways == Approx(0.3).epsilon(0.05));  // N
  CHECK(felt.highest - felt.lowest <= 5e-5);          // m
}

TEST_CASE("A tool wider than the tiles, and one that hangs over their side, slide as on one slab") {
  const Tool wide = tool_of("wide box", "<box><size>0.03 0.13 0.03</size></box>", 0.015);
  check_smooth(slide({wide, tiled_floor(kStep, kGap)}));
  check_smooth(slide({kBox, tiled_floor(0, kGap), {2.5 * kTile, 0.04, 0}}));
}

TEST_CASE("The seam in a tool of two pieces is not felt, on tiles and on two beams") {
  const Tool two{"two boxes",
                 box_at("a", {-0.01, 0, 0}, {0.02, 0.03, 0.03}) +
                     box_at("b", {0.01, 0.005, 0}, {0.02, 0.04, 0.03}),
                 0.015};
  check_smooth(slide({two, tiled_floor(kStep, kGap)}));
  const std::string beams = box_at("left", {0.2, 0.012, -0.01}, {0.4, 0.004, 0.02}) +
                            box_at("right", {0.2, -0.011, -0.01}, {0.4, 0.004, 0.02});
  check_smooth(slide({two, fixed_model("beams", "0 0 0 0 0 0", beams)}));
}

TEST_CASE("On top of the playground's block, across two seams, nothing is felt sideways") {
  std::string block;
  for (const auto& [p, size] : {std::pair{Vector3(-0.046, 0, 0), Vector3(0.06, 0.152, 0.06)},
                                {Vector3(0.046, 0, 0), Vector3(0.06, 0.152, 0.06)},
                                {Vector3(0, -0.046, 0), Vector3(0.032, 0.06, 0.06)},
                                {Vector3(0, 0.046, 0), Vector3(0.032, 0.06, 0.06)}}) {
    block += box_at("piece" + std::to_string(block.size()), p, size);
  }
  const std::string floor = fixed_model("block", "0.15 0 -0.03 0 0 0", block);
  check_smooth(slide({kBox, floor, {0.1, -0.046, 0}, {0.1, 0, 0}}));
}

TEST_CASE("A floor bears a tool that is pressed into a corner, also where it goes on under walls") {
  const std::string room = box_at("floor", {0, 0, -0.01}, {0.3, 0.3, 0.02}) +
                           box_at("x", {0.06, 0, 0.02}, {0.02, 0.3, 0.04}) +
                           box_at("y", {0, 0.06, 0.02}, {0.3, 0.02, 0.04});
  const Tool vertex_down =
      tool_of("vertex", "<box><size>0.03 0.03 0.03</size></box>", 0.015 * std::numbers::sqrt3,
              "0 0 0 0.7853981633974483 0.6154797086703874 0");
  const std::string floor = fixed_model("room", "0 0 0 0 0 0", room);
  const Slide felt = slide({vertex_down, floor, {0.02, 0.021, 0}, {0.02, 0.02, 0}});
  CHECK(felt.sideways > 1);     // N: it is pressed into the corner.
  CHECK(felt.lowest > -3e-4);   // m: f/k is 0.25 mm.
  CHECK(felt.highest < -2e-4);  // m
}

TEST_CASE("A plate lies flat on any number of feet, and sinks as far on 4 contacts as on 256") {
  const double push = 5;  // N
  for (const int count : {1, 2, 4, 8}) {
    Task task{kPlate, feet(count), Vector3::Zero(), {0.001, 0, 0}, 0, push};
    task.shapes = false;
    const Slide felt = slide(task);
    CHECK(felt.lean < 0.1);  // degrees
    CHECK(felt.lowest == Approx(-push / (4 * 4000)).epsilon(0.05));
    CHECK(felt.highest == Approx(-push / (4 * 4000)).epsilon(0.05));
  }
}

TEST_CASE("A plate lies flat on 8 x 8 tiles without gaps too") {
  check_smooth(slide({kPlate, tiled_square(0, 0), {0.12, 0.12, 0}, {0.02, 0.01, 0}}));
}

TEST_CASE("A bar that reaches over the edges of a concave mesh rests on it") {
  // A step of 0.1 m: its lower part is 0.1 m wide, the bar 0.104 m.
  const MeshFloor block(
      "v -0.1 -0.05 -0.05\nv 0.14 -0.05 -0.05\nv 0.14 -0.05 0.05\nv 0.1 -0.05 0.05\nv 0.1 -0.05 0\n"
      "v -0.1 -0.05 0\nv -0.1 0.05 -0.05\nv 0.14 0.05 -0.05\nv 0.14 0.05 0.05\nv 0.1 0.05 0.05\n"
      "v 0.1 0.05 0\nv -0.1 0.05 0\nf 1 2 5\nf 7 11 8\nf 2 3 5\nf 8 11 9\nf 3 4 5\nf 9 11 10\n"
      "f 1 5 6\nf 7 12 11\nf 1 7 8\nf 1 8 2\nf 2 8 9\nf 2 9 3\nf 3 9 10\nf 3 10 4\nf 4 10 11\n"
      "f 4 11 5\nf 5 11 12\nf 5 12 6\nf 6 12 7\nf 6 7 1\n");
  const Tool bar = tool_of("bar", "<box><size>0.02 0.104 0.01</size></box>", 0.005);
  check_smooth(slide({bar, block.model(), {-0.05, 0, 0}, {0.1, 0, 0}}));
}

// Floors as people make them, drawn at random.

/// Rectangles of triangles at about z = 0, each with corners of its own: OBJ text.
class Sheet {
 public:
  Sheet(Random& random, double noise) : random_(random), noise_(noise) {}

  /// A rectangle in x from a to b and y from c to d, in two triangles.
  void add(double a, double b, double c, double d) {
    const int first = corners_ + 1;
    for (const auto& [x, y] : {std::pair{a, c}, {b, c}, {b, d}, {a, d}}) {
      obj_ += "v " + numbers({x, y, random_.uniform(-noise_, noise_)}) + '\n';
    }
    corners_ += 4;
    const auto face = [&](int i, int j, int k) {
      triangles_ += "f " + std::to_string(first + i) + ' ' + std::to_string(first + j) + ' ' +
                    std::to_string(first + k) + '\n';
    };
    if (random_.integer(0, 1) == 0) {
      face(0, 1, 2), face(0, 2, 3);
    } else {
      face(0, 1, 3), face(1, 2, 3);
    }
  }
  std::string text() const { return obj_ + triangles_; }

 private:
  Random& random_;
  double noise_;  ///< m
  int corners_ = 0;
  std::string obj_, triangles_;
};

constexpr double kFloor = 0.24;  // m, its side.

/// Rows of tiles with widths of their own that start anywhere: use(x, x end, y, y end).
template <class Use>
void for_each_tile(Random& random, bool bonded, Use use) {
  for (double y = 0; y < kFloor - 0.001;) {
    const double depth = bonded ? random.uniform(0.015, 0.04) : kTile;
    double x = bonded ? -random.uniform(0, 0.02) : 0;
    while (x < kFloor - 0.001) {
      const double width = bonded ? random.uniform(0.015, 0.04) : kTile;
      use(x, x + width, y, y + depth);
      x += width;
    }
    y += depth;
  }
}

std::string random_tiles(Random& random, bool bonded, double noise, double step) {
  std::string collisions;
  int count = 0;
  for_each_tile(random, bonded, [&](double a, double b, double c, double d) {
    const double top = random.uniform(-step, 0);
    const Vector3 size(b - a + random.uniform(-noise, 0), d - c + random.uniform(-noise, 0), 0.02);
    collisions +=
        box_at("tile" + std::to_string(count++), {(a + b) / 2, (c + d) / 2, top - 0.01}, size);
  });
  return fixed_model("floor", "0 0 0 0 0 0", collisions);
}

struct RandomFloor {
  std::string name;
  std::string models;
  std::vector<std::unique_ptr<MeshFloor>> meshes;

  void add(const Sheet& sheet, const std::string& model) {
    meshes.push_back(std::make_unique<MeshFloor>(sheet.text()));
    models += meshes.back()->model(model);
  }
};

RandomFloor random_floor(Random& random, int kind) {
  RandomFloor floor;
  const double noise = random.uniform(0, 5e-6);  // m
  switch (kind) {
    case 0:
      floor.name = "tiles with gaps and steps";
      floor.models = random_tiles(random, false, 1e-4, 1e-5);
      break;
    case 1:
      floor.name = "bonded tiles";
      floor.models =
          random_tiles(random, true, random.integer(0, 1) * 1e-4, random.integer(0, 1) * 1e-5);
      break;
    case 2: {
      floor.name = "one sheet with T-junctions";
      Sheet sheet(random, noise);
      for_each_tile(random, true, [&](auto... sides) { sheet.add(sides...); });
      floor.add(sheet, "sheet");
      break;
    }
    case 3: {
      floor.name = "two sheets that adjoin";
      const double seam = random.uniform(0.08, 0.16);
      Sheet left(random, noise), right(random, noise);
      for_each_tile(random, true, [&](double a, double b, double c, double d) {
        if (a < seam) left.add(a, std::min(b, seam), c, d);
        if (b > seam) right.add(std::max(a, seam), b, c, d);
      });
      floor.add(left, "left");
      floor.add(right, "right");
      break;
    }
    case 4: {
      floor.name = "two sheets that overlap";
      Sheet one(random, noise), other(random, noise);
      one.add(0, random.uniform(0.14, 0.2), 0, kFloor);
      other.add(random.uniform(0.04, 0.1), kFloor, 0, kFloor);
      floor.add(one, "one");
      floor.add(other, "other");
      break;
    }
    case 5: {
      floor.name = "a sheet with slivers";
      Sheet sheet(random, noise);
      double x = 0;
      while (x < kFloor) {
        const double width = random.integer(0, 1) == 0 ? 1e-4 : random.uniform(0.01, 0.04);
        sheet.add(x, x + width, 0, kFloor);
        x += width;
      }
      floor.add(sheet, "sheet");
      break;
    }
    default: {
      floor.name = "tiles beside a sheet";
      Sheet sheet(random, noise);
      sheet.add(0.1, kFloor, 0, kFloor);
      floor.add(sheet, "sheet");
      floor.models += fixed_model("slab", "0 0 0 0 0 0",
                                  box_at("slab", {0.05, kFloor / 2, -0.01}, {0.1, kFloor, 0.02}));
    }
  }
  return floor;
}

void check_random_floors(int count) {
  Random random;
  int pushed = 0;  // Floors that push sideways by more than 0.05 N.
  int uneven = 0;  // Floors on which the depth changes by more than 0.05 mm.
  for (int i = 0; i < count; ++i) {
    const RandomFloor floor = random_floor(random, i % 7);
    const std::array tools{kBox, kSphere, kPeg, kCapsule};
    const Tool& tool = tools[static_cast<std::size_t>(random.integer(0, 3))];
    const Vector3 start(random.uniform(0.04, 0.08), random.uniform(0.04, 0.08), 0);
    const Vector3 path(random.uniform(0.08, 0.12), random.uniform(-0.01, 0.12), 0);
    const Slide felt = slide({tool, floor.models, start, path, random.integer(0, 1) * 0.5});
    const double depth = felt.highest - felt.lowest;
    pushed += felt.sideways > 0.05;
    uneven += depth > 5e-5;
    if (felt.sideways > 0.05 || depth > 5e-5) {
      std::cout << fmt::format("floor {}, {}, {}: {:.3f} N, {:.3f} mm\n", i, floor.name, tool.name,
                               felt.sideways, 1e3 * depth);
    }
  }
  CHECK(pushed <= count / 50);
  CHECK(uneven <= count / 10);
}

TEST_CASE("Floors drawn at random, of tiles and sheets, are felt as one slab") {
  check_random_floors(35);
}

// test_internal_edges "[.floors]"
TEST_CASE("The same of a thousand floors", "[.floors]") { check_random_floors(1000); }

}  // namespace
}  // namespace hlm::test
