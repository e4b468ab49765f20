// Worlds of several pieces whose surfaces go on in each other, felt by the hand: server and client
// together, in virtual time.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <utility>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

constexpr double kTile = 0.02;  // m, length of a tile along x.
constexpr int kTiles = 20;

const std::string kFrictionless =
    "<surface><friction><ode><mu>0</mu></ode></friction></surface></collision>";

std::string numbers(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) text += std::to_string(value) + ' ';
  return text;
}

std::string collision(const std::string& name, const std::string& pose, const std::string& shape) {
  return "<collision name='" + name + "'><pose>" + pose + "</pose><geometry>" + shape +
         "</geometry>" + kFrictionless;
}

std::string box_at(const std::string& name, const Vector3& p, const Vector3& size) {
  return collision(name, numbers({p.x(), p.y(), p.z(), 0, 0, 0}),
                   "<box><size>" + numbers({size.x(), size.y(), size.z()}) + "</size></box>");
}

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

/// A floor that is a mesh, in a file of its own.
class MeshFloor {
 public:
  explicit MeshFloor(const std::string& obj)
      : file_(std::filesystem::temp_directory_path() /
              ("haptic_floor_" + std::to_string(getpid()) + ".obj")) {
    std::ofstream(file_) << obj;
  }
  ~MeshFloor() { std::filesystem::remove(file_); }
  MeshFloor(const MeshFloor&) = delete;
  MeshFloor& operator=(const MeshFloor&) = delete;

  std::string model() const {
    const std::string mesh = "<mesh><uri>" + file_.string() + "</uri></mesh>";
    return fixed_model("floor", "0 0 0 0 0 0", collision("mesh", "0 0 0 0 0 0", mesh));
  }

 private:
  std::filesystem::path file_;
};

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

struct Tool {
  std::string name;
  std::string collisions;
  double height;  ///< Of its origin over the floor where it touches, m.
};

Tool tool_of(const std::string& name, const std::string& shape, double height,
             const std::string& pose = "0 0 0 0 0 0") {
  return {name, collision(name, pose, shape), height};
}

const Tool kBox = tool_of("box", "<box><size>0.03 0.03 0.03</size></box>", 0.015);
const Tool kSphere = tool_of("sphere", "<sphere><radius>0.01</radius></sphere>", 0.01);
const Tool kPeg =
    tool_of("peg", "<cylinder><radius>0.01</radius><length>0.04</length></cylinder>", 0.02);
const Tool kCapsule =
    tool_of("capsule", "<capsule><radius>0.008</radius><length>0.03</length></capsule>", 0.008,
            "0 0 0 0 1.5707963267948966 0");
const Tool kPlate = tool_of("plate", "<box><size>0.17 0.17 0.01</size></box>", 0.005);

/// A hand of 200 N/m leads a tool over a floor.
struct Task {
  Tool tool;
  std::string floor;
  Vector3 start = Vector3(2.5 * kTile, 0.0003, 0);  ///< Where the tool touches the floor, m.
  Vector3 path = Vector3((kTiles - 5) * kTile, 0, 0);
  double turn = 0;  ///< About z on the way, rad.
  double push = 1;  ///< N.
  double friction = 0;
};

/// What the hand felt on the way.
struct Slide {
  double sideways = 0;  ///< Largest contact force along the floor, N.
  double lowest = 1;    ///< Of the proxy against where it touches, m.
  double highest = -1;
  double tilt = 0;    ///< Largest tilt of a local contact's normal, degrees.
  double lean = 0;    ///< Largest tilt of the proxy, degrees.
  double missed = 0;  ///< Of the proxy from the path's end along the floor, m.
};

double degrees_off_z(const Vector3& v) {
  return std::atan2(v.head<2>().norm(), v.z()) * 180 / std::numbers::pi;
}

Slide slide(const Task& task) {
  const Tool& tool = task.tool;
  const Vector3 p = task.start + Vector3(0, 0, tool.height + 0.002);
  VirtualSessionOptions options;
  options.world = world_of(model("tool", numbers({p.x(), p.y(), p.z(), 0, 0, 0}), tool.collisions) +
                           task.floor);
  options.tool = "tool";
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.dry_friction = 0;
  options.servo.local_model.static_friction = task.friction;
  options.servo.local_model.kinetic_friction = task.friction;
  options.frame.report_friction = {};
  const server::Grip grip;
  const Vector3 down(0, 0, -0.002 - task.push / grip.stiffness);
  const Vector3 turn(0, 0, task.turn);
  constexpr double kSettling = 2;  // s
  options.hand = {{{kSettling, server::Reach{down, {}, true, grip}},
                   {3, server::Reach{down + task.path, turn, true, grip}}},
                  server::AfterLastSegment::kHold};

  Slide felt;
  VirtualSession* running = nullptr;
  VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.time < kSettling) return;
    felt.sideways = std::max(felt.sideways, record.F_env.head<2>().norm());
    const double height = record.X_WP.p.z() - tool.height;
    felt.lowest = std::min(felt.lowest, height);
    felt.highest = std::max(felt.highest, height);
    felt.lean = std::max(felt.lean, degrees_off_z(record.X_WP.R * Vector3::UnitZ()));
    for (const auto& contact : running->servo().local_model()->contacts()) {
      felt.tilt = std::max(felt.tilt, degrees_off_z(contact.now.n_W));
    }
  });
  running = &session;
  session.run(6);
  CHECK(session.last().fault == Fault::kNone);
  felt.missed = (session.last().X_WP.p - p - task.path).head<2>().norm();
  UNSCOPED_INFO(tool.name << ": sideways " << felt.sideways << " N, z " << 1e3 * felt.lowest
                          << " to " << 1e3 * felt.highest << " mm, normals off by " << felt.tilt
                          << "°, leans " << felt.lean << "°, missed " << 1e3 * felt.missed
                          << " mm");
  return felt;
}

/// As on one slab.
void check_smooth(const Slide& felt) {
  CHECK(felt.sideways <= 0.05);               // N
  CHECK(felt.tilt <= 0.1);                    // degrees
  CHECK(felt.highest - felt.lowest <= 5e-5);  // m
  CHECK(felt.missed <= 1e-4);                 // m
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
    const Slide felt = slide({kPlate, feet(count), Vector3::Zero(), {0.001, 0, 0}, 0, push});
    CHECK(felt.lean < 0.1);  // degrees
    CHECK(felt.lowest == Approx(-push / (4 * 4000)).epsilon(0.05));
    CHECK(felt.highest == Approx(-push / (4 * 4000)).epsilon(0.05));
  }
}

TEST_CASE("A plate lies flat on 8 x 8 tiles without gaps too") {
  check_smooth(slide({kPlate, tiled_square(0, 0), {0.12, 0.12, 0}, {0.02, 0.01, 0}}));
}

}  // namespace
}  // namespace hlm::test
