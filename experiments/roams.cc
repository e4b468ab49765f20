// What is felt by a peg that roams about the testbed's room and the mouth of its hole, led or
// pushed at random, tick by tick against the walls as they are; with fixed and with adapting ε.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/corners.h"
#include "experiments/experiments.h"
#include "hlm/common/uniform.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

using Point = Eigen::Vector2d;

// The testbed (worlds/testbed.sdf), m.
constexpr double kLeft = 0.08;           // Of the hole, x.
constexpr double kRight = 0.12;          // Of the hole, x.
constexpr double kMouth = 0.144;         // y
constexpr double kFloor = 0.224;         // y
constexpr double kWall = 0.18;           // Of the room, |x|.
constexpr double kTop = -0.2;            // Of the room, y.
constexpr double kPegHalfLength = 0.04;  // Along the hole.

const std::array<Point, 9> kSurface{{{-kWall, kTop},
                                     {kWall, kTop},
                                     {kWall, kMouth},
                                     {kRight, kMouth},
                                     {kRight, kFloor},
                                     {kLeft, kFloor},
                                     {kLeft, kMouth},
                                     {-kWall, kMouth},
                                     {-kWall, kTop}}};

/// How far a point is from the walls, m; negative in them.
double clearance(const Point& p) {
  double distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < kSurface.size(); ++i) {
    const Point along = kSurface[i + 1] - kSurface[i];
    const double share = std::clamp((p - kSurface[i]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    distance = std::min(distance, (p - kSurface[i] - share * along).norm());
  }
  const bool in_room = std::abs(p.x()) < kWall && p.y() > kTop && p.y() < kMouth;
  const bool in_hole = p.x() > kLeft && p.x() < kRight && p.y() >= kMouth && p.y() < kFloor;
  return in_room || in_hole ? distance : -distance;
}

/// How far the peg is from the walls, m; negative where it overlaps them.
double gap(const Pose& X_WP, double half_width) {
  constexpr int kPoints = 40;  // Of each half side: 1 mm apart along the peg.
  double gap = std::numeric_limits<double>::infinity();
  const auto look = [&](double along, double across) {
    const Vector3 p_W = X_WP * Vector3(along, across, 0);
    gap = std::min(gap, clearance(p_W.head<2>()));
  };
  for (int i = -kPoints; i <= kPoints; ++i) {
    const double share = static_cast<double>(i) / kPoints;
    for (const double side : {-1.0, 1.0}) {
      look(share * kPegHalfLength, side * half_width);
      look(side * kPegHalfLength, share * half_width);
    }
  }
  for (const double x : {kLeft, kRight}) {
    const Vector3 edge = X_WP.inverse() * Vector3(x, kMouth, 0);
    const double depth =
        std::min(kPegHalfLength - std::abs(edge.x()), half_width - std::abs(edge.y()));
    if (depth > 0) gap = std::min(gap, -depth);
  }
  return gap;
}

constexpr double kUpright = std::numbers::pi / 2;
const Vector3 kStart{0.1, 0.13, 0};

/// To and fro before the hole, into it and out again, at up to some 0.4 m/s and 5 rad/s.
server::HandScript roaming_hand(std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto between = [&](double low, double high) { return uniform(engine, low, high); };
  server::HandScript hand;
  hand.after = server::AfterLastSegment::kHold;
  for (int i = 0; i < 16; ++i) {
    const bool before = i % 4 == 1;
    const bool inside = i % 4 == 2;
    Vector3 p{between(0.05, 0.15), between(0.02, 0.15), 0};
    if (before || inside) {
      p = {0.1 + between(-0.0008, 0.0008), before ? 0.08 : between(0.15, 0.19), 0};
    }
    server::Reach reach;
    reach.relative = true;
    reach.position = p - kStart;
    reach.rotation = Vector3(0, 0, before || inside ? between(-0.01, 0.01) : between(-0.7, 0.7));
    reach.grip = {.stiffness = 400,
                  .damping = 60,
                  .angular_stiffness = 3,
                  .angular_damping = 0.1,
                  .max_force = 12,
                  .max_torque = 0.5};
    hand.segments.push_back({between(0.4, 0.9), reach});
  }
  return hand;
}

/// Thrown about the room: pushes of up to 7 N in random directions.
server::HandScript pushing_hand(std::uint64_t seed) {
  constexpr double kLargest = 7;   // N
  constexpr double kDuration = 8;  // s
  constexpr double kWait = 0.5;    // s, for the first contacts.
  std::mt19937_64 engine(seed);
  server::HandScript hand{.segments = {{kWait, server::Push{}}}};
  for (double left = kDuration; left > 0; left -= hand.segments.back().duration) {
    const double angle = uniform(engine, 0, 2 * std::numbers::pi);
    const double force = uniform(engine, 0, kLargest);
    server::Push push;
    push.constant.head<3>() = force * Vector3(std::cos(angle), std::sin(angle), 0);
    hand.segments.push_back({uniform(engine, 0.1, 0.6), push});
  }
  return hand;
}

enum class Hand : std::uint8_t { kLeads, kPushes };

/// What is sent of the walls.
struct Setting {
  const char* name;
  Hand hand;
  CornerConditions conditions;
};
constexpr std::array kSettings{
    Setting{"shapes", Hand::kLeads, {}}, Setting{"planes", Hand::kLeads, {.shapes = false}},
    Setting{"shapes", Hand::kPushes, {}}, Setting{"planes", Hand::kPushes, {.shapes = false}}};

struct Roam {
  std::size_t setting = 0;
  double half_width = 0.02;  // m
  double delay = 0;          // Each way, s.
  std::uint64_t seed = 1;
};

struct RoamOutcome {
  double runs = 0;
  double ticks = 0;
  double ghosts = 0;         ///< Ticks with more than kGhostForce although nothing is near.
  double largest_ghost = 0;  // N
  double deepest = 0;        // m
  double leaves = 0;         ///< Runs in which the peg's middle gets into a wall.
  double largest_step = 0;   ///< Of force at an update, N.

  void add(const RoamOutcome& other) {
    runs += other.runs;
    ticks += other.ticks;
    ghosts += other.ghosts;
    largest_ghost = std::max(largest_ghost, other.largest_ghost);
    deepest = std::max(deepest, other.deepest);
    leaves += other.leaves;
    largest_step = std::max(largest_step, other.largest_step);
  }
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RoamOutcome, runs, ticks, ghosts, largest_ghost, deepest, leaves,
                                   largest_step)

RoamOutcome roam(const Roam& roam) {
  constexpr double kNear = 3e-4;       // m
  constexpr double kRestBefore = 0.5;  // s
  const Setting& setting = kSettings[roam.setting];
  CornerConditions conditions = setting.conditions;
  conditions.delay = roam.delay;
  ve::WorldDescription world =
      ve::with_model_at(test::repository_world("testbed.sdf"), "peg",
                        {kStart, Quaternion(Eigen::AngleAxisd(kUpright, Vector3::UnitZ()))});
  const int peg = ve::find_model(world, "peg").first_body;
  world.bodies[static_cast<std::size_t>(peg)].collisions.at(0).shape =
      ve::Box{{2 * kPegHalfLength, 2 * roam.half_width, 0.04}};
  const server::HandScript hand =
      setting.hand == Hand::kLeads ? roaming_hand(roam.seed) : pushing_hand(roam.seed);

  RoamOutcome outcome{.runs = 1};
  Vector3 before = Vector3::Zero();
  test::VirtualSession session(
      session_options(hand, world, conditions, roam.seed), [&](const server::TickRecord& record) {
        if (record.step == 0) return;
        const Vector3 F = record.F_env.head<3>();
        const double peg_gap = gap(record.X_WP, roam.half_width);
        ++outcome.ticks;
        outcome.deepest = std::max(outcome.deepest, -peg_gap);
        if (clearance(record.X_WP.p.head<2>()) < 0) outcome.leaves = 1;
        if (peg_gap > kNear && F.norm() > kGhostForce) {
          ++outcome.ghosts;
          outcome.largest_ghost = std::max(outcome.largest_ghost, F.norm());
        }
        if (record.adopted > 0) {
          outcome.largest_step = std::max(outcome.largest_step, (F - before).norm());
        }
        before = F;
      });
  double duration = kRestBefore;
  for (const auto& segment : hand.segments) duration += segment.duration;
  session.run(duration);
  return outcome;
}

std::vector<Roam> roams_of(Bench& bench) {
  std::vector<Roam> cases;
  for (std::size_t i = 0; i < kSettings.size(); ++i) {
    const bool led = kSettings[i].hand == Hand::kLeads;
    const int seeds = bench.quick() ? 4 : led ? 12 : 40;
    for (const std::uint64_t seed : bench.seed_list(seeds)) {
      for (const double half_width : {0.019, 0.02}) {
        for (const double delay : {0.0, 0.02, 0.05}) {
          cases.push_back({i, half_width, delay, seed});
        }
      }
    }
  }
  return cases;
}

std::string in_words(const RoamOutcome& o) {
  return fmt::format(
      "{:.2f} % of the ticks, {:.0f} mm deep and steps of {:.0f} N at most, {:g} of {:g} leave the "
      "room",
      100 * o.ghosts / o.ticks, 1e3 * o.deepest, o.largest_step, o.leaves, o.runs);
}

}  // namespace

void roams(Bench& bench) {
  const std::vector<Roam> cases = roams_of(bench);
  const auto inputs_of = [](const Roam& r) {
    const Setting& setting = kSettings[r.setting];
    return Inputs{{"hand", setting.hand == Hand::kLeads ? "led" : "pushed"},
                  {"setting", setting.name},
                  {"peg_width_m", 2 * r.half_width},
                  {"delay_s", r.delay},
                  {"seed", r.seed}};
  };
  const auto outcomes = bench.map(cases, inputs_of, roam);
  Table& table =
      bench.table("roams",
                  "hand,setting,peg_width_m,delay_s,seed,ghosts,largest_ghost_n,deepest_m,leaves,"
                  "largest_step_n");
  std::array<RoamOutcome, kSettings.size()> sums{};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto& [setting, half_width, delay, seed] = cases[i];
    const RoamOutcome& o = outcomes[i];
    table.row(kSettings[setting].hand == Hand::kLeads ? "led" : "pushed", kSettings[setting].name,
              2 * half_width, delay, static_cast<double>(seed), o.ghosts / o.ticks, o.largest_ghost,
              o.deepest, o.leaves, o.largest_step);
    sums[setting].add(o);
  }
  const auto& [led, led_by_planes, pushed, pushed_by_planes] = sums;
  bench.claim({.what = "a peg is led about the testbed's hole, 0 to 50 ms each way",
               .criterion =
                   "more than 0.5 N where nothing is within 0.3 mm, which a peg may move in "
                   "a tick, in less than 0.3 % of the ticks; less deep than with planes",
               .measured = in_words(led) + "; planes, ε = 5 mm: " + in_words(led_by_planes),
               .holds = led.ghosts < 0.003 * led.ticks && led.deepest < led_by_planes.deepest});
  bench.claim({.what = "a peg of 1 kg is pushed about the room at random with up to 7 N",
               .criterion = "its middle gets into no wall",
               .measured = in_words(pushed) + "; planes, ε = 5 mm: " + in_words(pushed_by_planes),
               .holds = pushed.leaves == 0});
}

}  // namespace hlm::experiments
