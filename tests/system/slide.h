// A hand leads a tool over a floor: server and client together, in virtual time.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <numbers>
#include <string>

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {

inline constexpr double kTile = 0.02;  // m, length of a tile along x.
inline constexpr int kTiles = 20;

inline const std::string kFrictionless =
    "<surface><friction><ode><mu>0</mu></ode></friction></surface></collision>";

inline std::string numbers(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) text += fmt::format("{} ", value);
  return text;
}

inline std::string collision(const std::string& name, const std::string& pose,
                             const std::string& shape) {
  return "<collision name='" + name + "'><pose>" + pose + "</pose><geometry>" + shape +
         "</geometry>" + kFrictionless;
}

inline std::string box_at(const std::string& name, const Vector3& p, const Vector3& size) {
  return collision(name, numbers({p.x(), p.y(), p.z(), 0, 0, 0}),
                   "<box><size>" + numbers({size.x(), size.y(), size.z()}) + "</size></box>");
}

/// A floor that is a mesh, in a file of its own.
class MeshFloor {
 public:
  explicit MeshFloor(const std::string& obj)
      : file_(std::filesystem::temp_directory_path() / ("haptic_floor_" + std::to_string(getpid()) +
                                                        '_' + std::to_string(count_++) + ".obj")) {
    std::ofstream(file_) << obj;
  }
  ~MeshFloor() { std::filesystem::remove(file_); }
  MeshFloor(const MeshFloor&) = delete;
  MeshFloor& operator=(const MeshFloor&) = delete;

  std::string model(const std::string& name = "floor",
                    const std::string& pose = "0 0 0 0 0 0") const {
    const std::string mesh = "<mesh><uri>" + file_.string() + "</uri></mesh>";
    return fixed_model(name, pose, collision("mesh", "0 0 0 0 0 0", mesh));
  }

 private:
  inline static int count_ = 0;
  std::filesystem::path file_;
};

struct Tool {
  std::string name;
  std::string collisions;
  double height;  ///< Of its origin over the floor where it touches, m.
};

inline Tool tool_of(const std::string& name, const std::string& shape, double height,
                    const std::string& pose = "0 0 0 0 0 0") {
  return {name, collision(name, pose, shape), height};
}

inline const Tool kBox = tool_of("box", "<box><size>0.03 0.03 0.03</size></box>", 0.015);
inline const Tool kSphere = tool_of("sphere", "<sphere><radius>0.01</radius></sphere>", 0.01);
inline const Tool kPeg =
    tool_of("peg", "<cylinder><radius>0.01</radius><length>0.04</length></cylinder>", 0.02);
inline const Tool kCapsule =
    tool_of("capsule", "<capsule><radius>0.008</radius><length>0.03</length></capsule>", 0.008,
            "0 0 0 0 1.5707963267948966 0");
inline const Tool kPlate = tool_of("plate", "<box><size>0.17 0.17 0.01</size></box>", 0.005);

/// A hand of 200 N/m leads a tool over a floor.
struct Task {
  Tool tool;
  std::string floor;
  Vector3 start = Vector3(2.5 * kTile, 0.0003, 0);  ///< Where the tool touches the floor, m.
  Vector3 path = Vector3((kTiles - 5) * kTile, 0, 0);
  double turn = 0;  ///< About z on the way, rad.
  double push = 1;  ///< N.
  double friction = 0;
  bool shapes = true;  ///< The server finds the contacts; else the client does.
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

inline double degrees_off_z(const Vector3& v) {
  return std::atan2(v.head<2>().norm(), v.z()) * 180 / std::numbers::pi;
}

inline Slide slide(const Task& task) {
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
  options.frame.shapes = task.shapes;
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
inline void check_smooth(const Slide& felt) {
  CHECK(felt.sideways <= 0.05);               // N
  CHECK(felt.tilt <= 0.1);                    // degrees
  CHECK(felt.highest - felt.lowest <= 5e-5);  // m
  CHECK(felt.missed <= 1e-4);                 // m
}

}  // namespace hlm::test
