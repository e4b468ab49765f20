// Pegs that enter holes and touch nothing, and a wall that is met in full motion.
#include "experiments/corners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <spdlog/fmt/fmt.h>

#include "experiments/over.h"
#include "hlm/common/uniform.h"
#include "tests/support/mesh_model.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

constexpr double kHalfWidth = 0.02;   // m, along x: of the peg, or of the testbed's hole
constexpr double kHalfLength = 0.04;  // m, of the peg, along y
constexpr double kRest = 0.3;         // s: before the hand begins, and after each reach

std::string block(const std::string& name, double x, double y, double width, double height) {
  return test::fixed_model(name, fmt::format("{} {} 0 0 0 0", x, y),
                           test::box(fmt::format("{} {} 0.04", width, height)));
}

/// A fixed box from the level of the mouth downwards, over these ranges, m.
std::string beneath(const std::string& name, double x_low, double x_high, double z_low,
                    double z_high) {
  return test::fixed_model(
      name, fmt::format("{} -0.07 {} 0 0 0", 0.5 * (x_low + x_high), 0.5 * (z_low + z_high)),
      test::box(fmt::format("{} 0.14 {}", x_high - x_low, z_high - z_low)));
}

/// Pieces that touch, with level tops, about a hole from -x to x and -z to z (m): four bars, or
/// eight tiles.
std::string level_pieces(Walls walls, double x, double z) {
  const double far = 0.1;
  if (walls == Walls::kBars) {
    return beneath("left", -far, -x, -far, far) + beneath("right", x, far, -far, far) +
           beneath("near", -x, x, z, far) + beneath("far", -x, x, -far, -z);
  }
  const std::array<double, 4> at_x{-far, -x, x, far};
  const std::array<double, 4> at_z{-far, -z, z, far};
  std::string tiles;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      if (i == 1 && j == 1) continue;
      tiles += beneath(fmt::format("tile_{}_{}", i, j), at_x[i], at_x[i + 1], at_z[j], at_z[j + 1]);
    }
  }
  return tiles;
}

/// Two blocks with a wedge on each side of the mouth, 20 mm wide and high, that leads into the
/// hole.
std::string wedges(double wall) {
  std::string models =
      block("left", -wall - 0.05, -0.08, 0.1, 0.12) + block("right", wall + 0.05, -0.08, 0.1, 0.12);
  for (const double side : {-1.0, 1.0}) {
    std::string points;
    for (const double z : {-0.02, 0.02}) {
      for (const auto& [x, y] : {std::pair{0.0, -0.02}, {0.02, 0.0}, {0.1, 0.0}, {0.1, -0.02}}) {
        points += fmt::format("v {} {} {}\n", side * (wall + x), y, z);
      }
    }
    const std::string faces =
        "f 1 2 3\nf 1 3 4\nf 5 7 6\nf 5 8 7\nf 1 5 6\nf 1 6 2\n"
        "f 2 6 7\nf 2 7 3\nf 3 7 8\nf 3 8 4\nf 4 8 5\nf 4 5 1\n";
    models += test::mesh_model(side < 0 ? "wedge_left" : "wedge_right", points + faces);
  }
  return models;
}

/// A block of 0.2 x 0.17 x 0.08 m whose surface is one mesh, with a slot of 2 `wall` along x.
std::string mesh_with_slot(double wall) {
  const std::array<std::pair<double, double>, 8> outline{{{-0.1, -0.17},
                                                          {0.1, -0.17},
                                                          {0.1, 0},
                                                          {wall, 0},
                                                          {wall, -0.14},
                                                          {-wall, -0.14},
                                                          {-wall, 0},
                                                          {-0.1, 0}}};
  std::string text;
  for (const double z : {-0.04, 0.04}) {
    for (const auto& [x, y] : outline) text += fmt::format("v {} {} {}\n", x, y, z);
  }
  const std::array<std::array<int, 3>, 6> caps{
      {{1, 6, 8}, {6, 7, 8}, {1, 2, 6}, {2, 5, 6}, {2, 3, 5}, {3, 4, 5}}};
  for (const auto& [a, b, c] : caps) {
    text += fmt::format("f {} {} {}\nf {} {} {}\n", a, c, b, a + 8, b + 8, c + 8);
  }
  for (int i = 1; i <= 8; ++i) {
    const int next = i % 8 + 1;
    text += fmt::format("f {} {} {}\nf {} {} {}\n", i, next, next + 8, i, next + 8, i + 8);
  }
  return test::mesh_model("block", text);
}

std::string peg(const Vector3& p, double half_width) {
  return test::model("peg", fmt::format("{} {} 0 0 0 0", p.x(), p.y()),
                     test::box(fmt::format("{} {} 0.04", 2 * half_width, 2 * kHalfLength)),
                     "<haptic:tool_joint>planar</haptic:tool_joint>");
}

/// The walls of the shipped testbed, with the hole's mouth at y = 0 and the hole below, and its
/// peg.
ve::WorldDescription testbed(const Vector3& p, double half_width) {
  const Pose X_WT{{-0.1, 0.144, 0},
                  Quaternion(Eigen::AngleAxisd(std::numbers::pi, Vector3::UnitX()))};
  ve::WorldDescription world = test::repository_world("testbed.sdf");
  world = ve::with_model_at(world, "enclosure", X_WT * ve::find_model(world, "enclosure").X_WM);
  world = ve::with_model_at(world, "peg", {p, Quaternion::Identity()});
  const int peg = ve::find_model(world, "peg").first_body;
  world.bodies[static_cast<std::size_t>(peg)].collisions.at(0).shape =
      ve::Box{{2 * half_width, 2 * kHalfLength, 0.04}};
  return world;
}

struct Path {
  Vector3 start;
  server::HandScript hand;
  double duration = 0;  ///< s.
  double matters = 0;   ///< When the peg is at the wall, or half in, s.
};

/// Before the hand begins, s.
double wait(const CornerConditions& conditions) {
  return kRest + 8 * conditions.delay + conditions.settling;
}

/// In its middle reports of the moment that matters would have been sent.
Outage outage_of(const Path& path, const CornerConditions& conditions) {
  if (conditions.outage == 0) return {};
  return {path.matters - conditions.delay - conditions.outage / 2, conditions.outage};
}

/// Into a hole with its mouth at y = 0: straight, or from the side, 3 mm above the mouth's edge,
/// and from there across the hole with a tilt.
Path path_of(const Entry& entry, const CornerConditions& conditions) {
  std::mt19937_64 engine(entry.seed);
  const auto within = [&](double most) { return uniform(engine, -most, most); };
  const double bottom = -0.06;
  Path path;
  auto& segments = path.hand.segments;
  path.hand.after = server::AfterLastSegment::kHold;
  const Vector3 mouth(within(0.6 * entry.clearance), kHalfLength + 0.003, 0);
  path.start = mouth;
  if (entry.wanders) {
    path.start.x() += std::copysign(uniform(engine, 0.015, 0.03), within(1));
  } else {
    path.start.y() += 0.05;
  }
  const server::HandSegment waits = firm_reach(wait(conditions), path.start);
  segments.push_back(waits);
  if (entry.wanders) {
    segments.push_back(firm_reach(duration_of((mouth - path.start).norm(), entry.speed), mouth));
    segments.push_back(firm_reach(kRest, mouth));
  }
  Vector3 end(mouth.x(), kHalfLength + bottom, 0);
  double tilt = 0;
  if (entry.wanders) {
    end.x() = within(0.6 * entry.clearance);
    tilt = within(0.2 * entry.clearance / kHalfLength);
  }
  const Vector3 from = entry.wanders ? mouth : path.start;
  segments.push_back(firm_reach(duration_of((end - from).norm(), entry.speed), end, tilt));
  segments.push_back(firm_reach(kRest, end, tilt));
  for (const auto& segment : segments) path.duration += segment.duration;
  path.matters = path.duration - kRest - duration_of((end - from).norm(), entry.speed) / 2;
  return path;
}

/// Gap of the peg from a wall of the hole: x beyond `wall` on the side of `side` (+1, -1), y < 0.
double gap(const Pose& X_WP, double half_width, double side, double wall) {
  std::array<Vector3, 4> corners;
  double along_x = std::numeric_limits<double>::infinity();
  double along_y = along_x;
  for (std::size_t i = 0; i < 4; ++i) {
    corners[i] =
        X_WP * Vector3(i & 1 ? half_width : -half_width, i & 2 ? kHalfLength : -kHalfLength, 0);
    along_x = std::min(along_x, wall - side * corners[i].x());
    along_y = std::min(along_y, corners[i].y());
  }
  // The wall's edge in the axes of the peg.
  const Vector3 edge = X_WP.inverse() * Vector3(side * wall, 0, 0);
  const double along_own_x = std::abs(edge.x()) - half_width;
  const double along_own_y = std::abs(edge.y()) - kHalfLength;
  // Of the peg's own axes only those that leave the whole wall on one side separate them.
  const bool level = std::abs(X_WP.R.z()) < 1e-9;
  const double own =
      level ? -1
            : std::max(side * edge.x() > 0 ? along_own_x : -1, edge.y() < 0 ? along_own_y : -1);
  return std::max({along_x, along_y, own});
}

}  // namespace

test::VirtualSessionOptions session_options(const server::HandScript& hand,
                                            const ve::WorldDescription& world,
                                            const CornerConditions& conditions,
                                            std::uint64_t seed) {
  test::VirtualSessionOptions options;
  options.world = world;
  options.hand = hand;
  options.device.dry_friction = 0;
  options.device.max_force = 100;
  options.device.max_torque = 5;
  options.device.max_force_rate = 1e9;
  options.servo.limits.max_force = 100;
  options.servo.limits.max_torque = 5;
  options.servo.handle = {.max_speed = 1e9, .max_rate = 1e9, .workspace = 1e9};
  options.servo.silence_time = 2;
  options.link = {.delay = conditions.delay, .loss = conditions.loss};
  options.seed = seed;
  options.rate_low = conditions.ve_low;
  options.rate_high = conditions.ve_high;
  options.frame = {.shapes = conditions.shapes, .epsilon = conditions.epsilon};
  use_device(conditions.device, options.device);
  if (conditions.method) {
    use(*conditions.method, conditions.stiffness, options.servo.local_model.damping, options);
  }
  return options;
}

server::HandSegment firm_reach(double duration, const Vector3& p, double angle) {
  server::Reach reach;
  reach.position = p;
  reach.rotation = Vector3(0, 0, angle);
  reach.grip = {.stiffness = 2000,
                .damping = 80,
                .angular_stiffness = 10,
                .angular_damping = 0.3,
                .max_force = 100,
                .max_torque = 5};
  return {duration, reach};
}

double duration_of(double length, double speed) { return 1.875 * length / speed; }

namespace {

/// Of the peg, m.
double half_width_of(const Entry& entry) {
  return entry.walls == Walls::kTestbed ? kHalfWidth - entry.clearance : kHalfWidth;
}

}  // namespace

double least_gap(const Entry& entry, const CornerConditions& conditions) {
  const Path path = path_of(entry, conditions);
  const double half_width = half_width_of(entry);
  const double wall = half_width + entry.clearance;
  double least = std::numeric_limits<double>::infinity();
  test::VirtualSession session(
      session_options(path.hand, test::world_of(peg(path.start, half_width)), conditions,
                      entry.seed),
      [&](const server::TickRecord& record) {
        if (record.step == 0) return;
        for (const double side : {-1.0, 1.0}) {
          least = std::min(least, gap(record.X_WP, half_width, side, wall));
        }
      });
  session.run(path.duration + kRest + 2 * conditions.delay);
  return least;
}

EntryOutcome enter(const Entry& entry, const CornerConditions& conditions) {
  const Path path = path_of(entry, conditions);
  const double half_width = half_width_of(entry);
  const double wall = half_width + entry.clearance;
  const std::string tool = peg(path.start, half_width);
  EntryOutcome outcome;
  const auto hole = [&] {
    switch (entry.walls) {
      case Walls::kTestbed:
        return testbed(path.start, half_width);
      case Walls::kBars:
      case Walls::kTiles:
        return test::world_of(level_pieces(entry.walls, wall, 0.02 + entry.clearance) + tool);
      case Walls::kMesh:
        return test::world_of(mesh_with_slot(wall) + tool);
      case Walls::kWedges:
        return test::world_of(wedges(wall) + tool);
      case Walls::kApart:
        break;
    }
    return test::world_of(block("left", -wall - 0.05, -0.07, 0.1, 0.14) +
                          block("right", wall + 0.05, -0.07, 0.1, 0.14) + tool);
  };
  double contacts = 0;
  double updates = 0;
  test::VirtualSession* running = nullptr;
  const test::VirtualSessionOptions options =
      session_options(path.hand, hole(), conditions, entry.seed);
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    cut(outage_of(path, conditions), record, options.link, *running);
    outcome.largest_force =
        std::max(outcome.largest_force, felt(conditions.method, record).head<3>().norm());
    if (record.adopted == 0) return;
    contacts += record.active_contacts + record.predicted_contacts;
    ++updates;
  });
  running = &session;
  session.run(path.duration + kRest + 2 * conditions.delay);
  outcome.enters = session.last().X_WP.p.y() < kHalfLength - 0.055;
  outcome.acting_contacts = contacts / std::max(1.0, updates);
  return outcome;
}

namespace {

struct Moment {
  double ahead;  ///< Of the wall, m.
  Vector3 felt;  ///< N.
};

/// Each tick of a way at up to `speed` (m/s) to a wall that is there or not.
std::vector<Moment> way_to_wall(bool there, double speed, const CornerConditions& conditions,
                                std::uint64_t seed) {
  // The hand is fastest half way, where the wall is.
  const double length = 0.3;
  Path path{.start = {0, length / 2 + kHalfLength, 0}, .hand = {}, .duration = 0};
  std::mt19937_64 engine(seed);
  const double waits = wait(conditions) + uniform(engine, 0, 0.05);
  const Vector3 end = path.start - Vector3(0, length, 0);
  path.hand = {{firm_reach(waits, path.start), firm_reach(duration_of(length, speed), end)},
               server::AfterLastSegment::kHold};
  path.matters = waits + duration_of(length, speed) / 2;
  const std::string tool = peg(path.start, kHalfWidth);
  const test::VirtualSessionOptions options = session_options(
      path.hand, test::world_of(there ? block("wall", 0, -0.05, 0.2, 0.1) + tool : tool),
      conditions, seed);
  std::vector<Moment> moments;
  test::VirtualSession* running = nullptr;
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.step == 0) return;
    cut(outage_of(path, conditions), record, options.link, *running);
    moments.push_back({record.X_WP.p.y() - kHalfLength, felt(conditions.method, record).head<3>()});
  });
  running = &session;
  session.run(kRest + 2 * conditions.delay + waits + duration_of(length, speed));
  return moments;
}

}  // namespace

double wall_error(double speed, const CornerConditions& conditions, std::uint64_t seed) {
  const std::vector<Moment> moments = way_to_wall(true, speed, conditions, seed);
  // A spring to an engine's tool is felt in free motion too.
  std::vector<Moment> free;
  if (conditions.method && couples_engine(*conditions.method)) {
    free = way_to_wall(false, speed, conditions, seed);
  }
  for (std::size_t i = 0; i < moments.size(); ++i) {
    const Vector3 without = i < free.size() ? free[i].felt : Vector3::Zero();
    if ((moments[i].felt - without).norm() >= 0.5) return std::abs(moments[i].ahead);
  }
  return std::numeric_limits<double>::infinity();
}

namespace {

constexpr std::array<const char*, 6> kWalls{"apart", "testbed", "bars", "tiles", "mesh", "wedges"};

}  // namespace

const char* name_of(Walls walls) { return kWalls[static_cast<std::size_t>(walls)]; }

Inputs inputs_of(const Entry& entry) {
  return {{"walls", name_of(entry.walls)},
          {"clearance_m", entry.clearance},
          {"speed_m_s", entry.speed},
          {"wanders", entry.wanders},
          {"seed", entry.seed}};
}

}  // namespace hlm::experiments
