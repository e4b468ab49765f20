// The geometry near the hand in the server: contacts of every tick against planes of every frame.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/corners.h"
#include "experiments/experiments.h"
#include "hlm/common/uniform.h"
#include "tests/support/mesh_model.h"

namespace hlm::experiments {
namespace {

struct Source {
  const char* name;
  bool shapes;
};
constexpr std::array kSources{Source{"shapes", true}, Source{"planes", false}};

CornerConditions conditions(const Source& source, double delay) {
  return {.delay = delay,
          .ve_low = source.shapes ? 20.0 : 30.0,
          .ve_high = 60,
          .shapes = source.shapes};
}

struct Ghosts {
  int entries = 0;
  int felt = 0;
  int stuck = 0;
  double largest = 0;  // N
};

/// With a clearance of 0.02 to 3 mm, at 0.05 to 1 m/s.
Entry random_entry(Walls walls, bool wanders, std::uint64_t seed) {
  std::mt19937_64 engine(seed * 100 + 2 * static_cast<std::uint64_t>(walls) + wanders);
  const auto between = [&](double low, double high) {
    return low * std::pow(high / low, uniform(engine, 0, 1));
  };
  const double clearance = between(2e-5, 3e-3);
  return {.clearance = clearance,
          .speed = between(0.05, 1),
          .wanders = wanders,
          .seed = seed,
          .walls = walls};
}

/// Free entries into every kind of hole.
void free_entries(Bench& bench) {
  constexpr std::array kKinds{Walls::kApart, Walls::kTestbed, Walls::kBars,
                              Walls::kTiles, Walls::kMesh,    Walls::kWedges};
  const std::vector<double> delays =
      bench.quick() ? std::vector{0.0, 0.25} : std::vector{0.0, 0.02, 0.1, 0.25, 0.5};
  struct FreeEntry {
    Entry entry;
    double delay;
    const Source* source;
  };
  std::vector<FreeEntry> cases;
  for (const std::uint64_t seed : bench.seed_list(bench.quick() ? 1 : 17)) {
    for (const Walls walls : kKinds) {
      for (const bool wanders : {false, true}) {
        for (const double delay : delays) {
          for (const Source& source : kSources) {
            cases.push_back({random_entry(walls, wanders, seed), delay, &source});
          }
        }
      }
    }
  }
  const auto inputs = [](const FreeEntry& c) {
    return Inputs{{"contacts", c.source->name}, {"delay_s", c.delay}} + inputs_of(c.entry);
  };
  const auto outcomes = bench.map(cases, inputs, [](const FreeEntry& c) {
    const bool is_free = least_gap(c.entry, {.delay = c.delay}) >= kTouchesNothing;
    return std::pair{is_free, enter(c.entry, conditions(*c.source, c.delay))};
  });
  Table& table = bench.table("shapes_entries",
                             "contacts,walls,wanders,delay_s,seed,free,largest_force_n,enters");
  std::map<std::pair<bool, Walls>, Ghosts> ghosts;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto& [entry, delay, source] = cases[i];
    const auto& [is_free, outcome] = outcomes[i];
    table.row(source->name, name_of(entry.walls), entry.wanders ? 1.0 : 0.0, delay,
              static_cast<double>(entry.seed), is_free ? 1.0 : 0.0, outcome.largest_force,
              outcome.enters ? 1.0 : 0.0);
    if (!is_free) continue;
    Ghosts& count = ghosts[{source->shapes, entry.walls}];
    ++count.entries;
    count.felt += outcome.largest_force > kGhostForce;
    count.stuck += !outcome.enters;
    count.largest = std::max(count.largest, outcome.largest_force);
  }
  for (const Walls walls : kKinds) {
    const Ghosts& now = ghosts[{true, walls}];
    const Ghosts& late = ghosts[{false, walls}];
    bench.claim(
        {.what = fmt::format("free entries into holes of kind '{}', shapes in the server, "
                             "to {:.0f} ms each way",
                             name_of(walls), 1e3 * delays.back()),
         .criterion = "none meets more than 0.5 N; all get in",
         .measured = fmt::format("{} of {}, up to {:.2g} N; {} do not get in (planes: {} of "
                                 "{}, up to {:.2g} N; {})",
                                 now.felt, now.entries, now.largest, now.stuck, late.felt,
                                 late.entries, late.largest, late.stuck),
         .holds = now.entries > 0 && now.felt == 0 && now.stuck == 0});
  }
}

/// A ring of boxes, or a mug that is upside down, is put over a post that stands along z, with 1 mm
/// to spare. Returns the largest force, N.
double put_over_post(bool mug, const CornerConditions& given, std::uint64_t seed) {
  constexpr double kPost = 0.02;        // m, radius
  constexpr double kClearance = 0.001;  // m
  constexpr double kSpeed = 0.35;       // m/s
  constexpr double kHeight = 0.05;      // m, of the wall
  const int parts = mug ? 24 : 16;
  const double apothem = kPost + kClearance;
  const double width = 2 * apothem * std::tan(std::numbers::pi / parts);
  std::string tool;
  const auto box = [&](const std::string& pose, const Vector3& size) {
    tool += fmt::format(
        "<collision name='c{}'><pose>{}</pose><geometry><box><size>{} {} {}</size>"
        "</box></geometry></collision>",
        tool.size(), pose, size.x(), size.y(), size.z());
  };
  for (int i = 0; i < parts; ++i) {
    const double angle = 2 * std::numbers::pi * i / parts;
    const double r = apothem + 0.002;
    box(fmt::format("{} {} 0 0 0 {}", r * std::cos(angle), r * std::sin(angle), angle),
        {0.004, width, kHeight});
  }
  if (mug) {
    box(fmt::format("0 0 {} 0 0 0", kHeight / 2 + 0.003), {0.04, 0.04, 0.006});
    for (int i = 0; i < 5; ++i)
      box(fmt::format("0.05 0 {} 0 0 0", 0.008 * (i - 2)), {0.01, 0.01, 0.008});
  }
  std::mt19937_64 engine(seed);
  const auto within = [&](double most) { return uniform(engine, -most, most); };
  const Vector3 start(within(0.02), within(0.02), 0.1);
  const Vector3 above(within(0.4) * kClearance, within(0.4) * kClearance, 0.1);
  const Vector3 down(above.x(), above.y(), 0.1 - 0.06);
  const std::string models =
      test::fixed_model("post", "0 0 0 0 0 0",
                        fmt::format("<collision name='post'><geometry><cylinder><radius>{}</radius>"
                                    "<length>0.1</length></cylinder></geometry></collision>",
                                    kPost)) +
      test::model("peg", fmt::format("{} {} {} 0 0 0", start.x(), start.y(), start.z()), tool);
  server::HandScript hand;
  hand.after = server::AfterLastSegment::kHold;
  hand.segments.push_back(firm_reach(0.3 + 10 * given.delay + uniform(engine, 0, 0.05), start));
  hand.segments.push_back(firm_reach(duration_of((above - start).norm(), kSpeed), above));
  hand.segments.push_back(firm_reach(0.3, above));
  hand.segments.push_back(firm_reach(duration_of(0.06, kSpeed), down));
  hand.segments.push_back(firm_reach(0.2, down));
  double ends = 0.3 + 2 * given.delay;
  for (const server::HandSegment& segment : hand.segments) ends += segment.duration;
  test::VirtualSessionOptions options = session_options(hand, test::world_of(models), given, seed);
  options.device.freedom = server::DeviceFreedom::kSpatial;
  double largest = 0;
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    largest = std::max(largest, record.F_env.head<3>().norm());
  });
  session.run(ends);
  return session.last().X_WP.p.z() < 0.045 ? largest : std::numeric_limits<double>::infinity();
}

void posts_within(Bench& bench) {
  struct Fit {
    bool mug;
    double delay;
    const Source* source;
    std::uint64_t seed;
  };
  std::vector<Fit> cases;
  for (const std::uint64_t seed : bench.seed_list(bench.quick() ? 1 : 10)) {
    for (const bool mug : {false, true}) {
      for (const double delay : {0.0, 0.1}) {
        for (const Source& source : kSources) cases.push_back({mug, delay, &source, seed});
      }
    }
  }
  const auto inputs = [](const Fit& c) {
    return Inputs{{"contacts", c.source->name},
                  {"tool", c.mug ? "mug" : "ring"},
                  {"delay_s", c.delay},
                  {"seed", c.seed}};
  };
  const auto forces = bench.map(cases, inputs, [](const Fit& c) {
    return put_over_post(c.mug, conditions(*c.source, c.delay), c.seed);
  });
  Table& table = bench.table("shapes_fits", "contacts,tool,delay_s,seed,largest_force_n");
  std::map<bool, Ghosts> ghosts;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    table.row(cases[i].source->name, cases[i].mug ? "mug" : "ring", cases[i].delay,
              static_cast<double>(cases[i].seed), forces[i]);
    Ghosts& count = ghosts[cases[i].source->shapes];
    ++count.entries;
    count.felt += forces[i] > kGhostForce;
    count.largest = std::max(count.largest, forces[i]);
  }
  bench.claim(
      {.what = "a ring of 16 boxes and a mug of 30 parts are put over a post, 1 mm to spare, to "
               "100 ms each way, shapes in the server",
       .criterion = "none meets more than 0.5 N",
       .measured = fmt::format("{} of {}, up to {:.2g} N (planes: {} of {}, up to {:.2g} N)",
                               ghosts[true].felt, ghosts[true].entries, ghosts[true].largest,
                               ghosts[false].felt, ghosts[false].entries, ghosts[false].largest),
       .holds = ghosts[true].felt == 0});
}

/// A wall across an ocean.
void far_walls(Bench& bench) {
  struct FarWall {
    double speed;  // m/s
    double delay;  // One way, s
    const Source* source;
    std::uint64_t seed;
  };
  std::vector<FarWall> cases;
  for (const std::uint64_t seed : bench.seed_list(bench.quick() ? 1 : 5)) {
    for (const double speed : {0.05, 0.25, 0.5, 1.0}) {
      for (const double delay : {0.0, 0.1, 0.25, 0.5}) {
        for (const Source& source : kSources) cases.push_back({speed, delay, &source, seed});
      }
    }
  }
  const auto inputs = [](const FarWall& c) {
    return Inputs{{"contacts", c.source->name},
                  {"speed_m_s", c.speed},
                  {"delay_s", c.delay},
                  {"seed", c.seed}};
  };
  const auto errors = bench.map(cases, inputs, [](const FarWall& c) {
    return wall_error(c.speed, conditions(*c.source, c.delay), c.seed);
  });
  Table& table = bench.table("shapes_walls", "contacts,speed_m_s,delay_s,seed,error_m");
  const double h = 1 / server::ServoOptions{}.rate;
  double worst = -1;
  double worst_of_planes = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto& [speed, delay, source, seed] = cases[i];
    table.row(source->name, speed, delay, static_cast<double>(seed), errors[i]);
    if (source->shapes) worst = std::max(worst, errors[i] - speed * h);
    if (!source->shapes) worst_of_planes = std::max(worst_of_planes, errors[i]);
  }
  bench.claim({.what = "a wall met at 0.05 to 1 m/s, 0 to 500 ms each way, shapes in the server",
               .criterion = "felt within v·h + 0.1 mm of where it is",
               .measured = fmt::format("v·h {:+.3f} mm at worst (planes: {:.3g} mm)", 1e3 * worst,
                                       1e3 * worst_of_planes),
               .holds = worst <= 1e-4});
}

struct Slide {
  double lost = 0;           ///< Share of ticks without force.
  double largest_force = 0;  ///< N.
  double depth_error = 0;    ///< Largest of |depth / (F/k) - 1|, means over kWindow.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Slide, lost, largest_force, depth_error)

/// A ball of 10 mm is pressed with 2 N onto a dome, or into a bowl, of 100 mm radius and slides
/// over it at up to `speed` (m/s).
Slide slide(bool bowl, double speed, const CornerConditions& given, std::uint64_t seed) {
  constexpr double kRadius = 0.1;
  constexpr double kBall = 0.01;
  constexpr double kPress = 2;     // N
  constexpr double kGrip = 2000;   // N/m
  constexpr double kWide = 0.6;    // rad from the top
  constexpr double kWindow = 0.2;  // s
  const double way = bowl ? kRadius - kBall : kRadius + kBall;
  const double deep = kPress / kGrip + kPress / server::LocalModelParameters{}.stiffness;
  const double aim = bowl ? way + deep : way - deep;
  const auto at = [&](double angle) {
    return Vector3(aim * std::sin(angle), (bowl ? -1 : 1) * aim * std::cos(angle), 0);
  };
  test::VirtualSessionOptions options;
  const std::string surface =
      "<surface><friction><ode><mu>0</mu></ode></friction></surface></collision>";
  const std::string dome =
      "<collision name='dome'><geometry><sphere><radius>0.1</radius></sphere>"
      "</geometry>" +
      surface;
  const std::string ground = bowl ? test::mesh_model("ground", test::bowl_obj(kRadius))
                                  : test::fixed_model("ground", "0 0 0 0 0 0", dome);
  Vector3 start = at(-kWide);
  start.y() += 0.01;
  const std::string tool =
      test::model("peg", fmt::format("{} {} 0 0 0 0", start.x(), start.y()),
                  "<collision name='ball'><geometry><sphere><radius>0.01</radius></sphere>"
                  "</geometry>" +
                      surface);
  server::HandScript hand;
  hand.after = server::AfterLastSegment::kHold;
  hand.segments.push_back(firm_reach(0.5 + 10 * given.delay, at(-kWide)));
  const double begins = hand.segments.front().duration;
  constexpr int kPieces = 8;
  double angle = -kWide;
  double ends = begins;
  for (int pass = 0; pass < 4; ++pass) {
    for (int i = 0; i < kPieces; ++i) {
      angle += (pass % 2 == 0 ? 2 : -2) * kWide / kPieces;
      server::HandSegment segment =
          firm_reach(duration_of(2 * kWide * way / kPieces, speed), at(angle));
      ends += segment.duration;
      hand.segments.push_back(segment);
    }
  }
  options = session_options(hand, test::world_of(ground + tool), given, seed);
  options.device.freedom = server::DeviceFreedom::kSpatial;
  Slide result;
  double ticks = 0;
  const double k = options.servo.local_model.stiffness;
  struct Window {
    double until = 0;
    double first = 0;  // m
    double depth = 0;  // Sum, m
    double force = 0;  // Sum, N
    int ticks = 0;
  };
  Window window{.until = begins + 0.2 + kWindow};
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.time < begins + 0.2 || record.time > ends) return;
    const double force = record.F_env.head<3>().norm();
    const double r = record.X_WP.p.norm();
    ++ticks;
    result.lost += force < 0.1;
    result.largest_force = std::max(result.largest_force, force);
    const double depth = bowl ? r - way : way - r;
    if (window.ticks++ == 0) window.first = depth;
    window.depth += depth;
    window.force += force;
    if (record.time < window.until) return;
    // F = k d + b d', and the mean of the damping is what the depth has changed by.
    const double damped = options.servo.local_model.damping * (depth - window.first) / kWindow;
    const double mean = window.force / window.ticks - damped;
    const double error = std::abs(k * window.depth / window.ticks / mean - 1);
    result.depth_error = std::max(result.depth_error, error);
    window = {.until = window.until + kWindow};
  });
  session.run(ends + 0.1);
  result.lost /= std::max(1.0, ticks);
  return result;
}

void slides(Bench& bench) {
  struct SlideCase {
    bool bowl;
    double delay;
    const Source* source;
    std::uint64_t seed;
  };
  std::vector<SlideCase> cases;
  for (const std::uint64_t seed : bench.seed_list(bench.quick() ? 1 : 3)) {
    for (const bool bowl : {false, true}) {
      for (const double delay : {0.0, 0.25}) {
        if (bench.quick() && delay == 0) continue;
        for (const Source& source : kSources) cases.push_back({bowl, delay, &source, seed});
      }
    }
  }
  const auto inputs = [](const SlideCase& c) {
    return Inputs{{"contacts", c.source->name},
                  {"ground", c.bowl ? "bowl" : "dome"},
                  {"delay_s", c.delay},
                  {"seed", c.seed}};
  };
  const auto outcomes = bench.map(cases, inputs, [](const SlideCase& c) {
    return slide(c.bowl, 0.5, conditions(*c.source, c.delay), c.seed);
  });
  Table& table =
      bench.table("shapes_slides", "contacts,ground,delay_s,seed,lost,largest_force_n,depth_error");
  for (const bool bowl : {false, true}) {
    std::map<bool, Slide> worst;
    for (std::size_t i = 0; i < cases.size(); ++i) {
      if (cases[i].bowl != bowl) continue;
      const Slide& one = outcomes[i];
      table.row(cases[i].source->name, bowl ? "bowl" : "dome", cases[i].delay,
                static_cast<double>(cases[i].seed), one.lost, one.largest_force, one.depth_error);
      Slide& all = worst[cases[i].source->shapes];
      all.lost = std::max(all.lost, one.lost);
      all.largest_force = std::max(all.largest_force, one.largest_force);
      all.depth_error = std::max(all.depth_error, one.depth_error);
    }
    const Slide& now = worst[true];
    bench.claim(
        {.what = fmt::format("a ball pressed with 2 N slides {} of 100 mm at 0.5 m/s, to 250 ms "
                             "each way, shapes in the server",
                             bowl ? "in a bowl" : "over a dome"),
         .criterion = "force never lost; depth F/k within 2 %",
         .measured = fmt::format(
             "lost {:.1f} % of the time, depth within {:.1f} %, at most {:.2f} N "
             "(planes: {:.0f} %, {:.0f} %, {:.1f} N)",
             100 * now.lost, 100 * now.depth_error, now.largest_force, 100 * worst[false].lost,
             100 * worst[false].depth_error, worst[false].largest_force),
         .holds = now.lost == 0 && now.depth_error <= 0.02});
  }
}

}  // namespace

void near_shapes(Bench& bench) {
  free_entries(bench);
  posts_within(bench);
  far_walls(bench);
  slides(bench);
}

}  // namespace hlm::experiments
