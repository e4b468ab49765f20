// What a hand perceives across an ocean: walls, holes and bodies over round trip, rate of the
// engine, speed and loss, with shapes in the server, with planes, and with the older couplings.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/body_tasks.h"
#include "experiments/corners.h"
#include "experiments/experiments.h"
#include "hlm/common/uniform.h"

namespace hlm::experiments {
namespace {

/// A method as this chapter calls it, how stiff it is, N/m, and the one that, without delay, says
/// what is due. The older couplings are as soft as they must be to be stable without delay.
struct Sight {
  const char* name;
  const char* method;
  double stiffness;
  const char* due;
  bool bodies;  ///< It can move some.
};
constexpr std::array kSights{Sight{"shapes", "shapes", 4000, "shapes", true},
                             Sight{"planes", "lm5", 4000, "shapes", true},
                             Sight{"IR", "ir", 1000, "shapes-direct", true},
                             Sight{"direct", "engine", 500, "shapes-direct", false}};

struct Network {
  const char* name;
  double loss;    ///< Share of datagrams.
  double outage;  ///< So long is all lost when it matters most, s.
};
constexpr std::array kNetworks{Network{"all arrives", 0, 0}, Network{"5 % lost", 0.05, 0},
                               Network{"300 ms lost", 0, Outage{}.duration}};

/// What lies between hand and engine.
struct Ocean {
  double round_trip = 0.2;  ///< s.
  double rate = 60;         ///< Of the engine, Hz.
  double speed = 0.3;       ///< Of the hand, m/s.
  Network network = kNetworks[0];
  std::string device{};  ///< File of the user's; empty: one without friction.
};

const std::vector<double> kRoundTrips{0, 0.05, 0.2, 0.5, 1};  // s
constexpr std::array kRates{15.0, 60.0, 200.0};               // Hz
constexpr std::array kSpeeds{0.05, 0.3, 1.0};                 // m/s

/// Each of the others alone, about the middle.
std::vector<Ocean> quick_oceans() {
  std::vector<Ocean> all;
  for (const double round_trip : kRoundTrips) all.push_back({.round_trip = round_trip});
  for (const double rate : {kRates.front(), kRates.back()}) all.push_back({.rate = rate});
  for (const double speed : {kSpeeds.front(), kSpeeds.back()}) all.push_back({.speed = speed});
  for (const Network& network : kNetworks) {
    if (network.name != kNetworks[0].name) all.push_back({.network = network});
  }
  return all;
}

std::vector<Ocean> oceans(const Bench& bench) {
  if (bench.quick()) return quick_oceans();
  std::vector<Ocean> all;
  for (const double round_trip : kRoundTrips) {
    for (const double rate : kRates) {
      for (const double speed : kSpeeds) {
        for (const Network& network : kNetworks) all.push_back({round_trip, rate, speed, network});
      }
    }
  }
  return all;
}

/// Until shapes are there, s: some frames, and more round trips where datagrams are lost.
double settling(const Ocean& ocean) {
  return 10 / ocean.rate + (ocean.network.loss > 0 ? 1 + 4 * ocean.round_trip : 0);
}

CornerConditions corner_conditions(const Ocean& ocean, const Sight& sight) {
  return {.delay = ocean.round_trip / 2,
          .ve_low = ocean.rate,
          .ve_high = ocean.rate,
          .loss = ocean.network.loss,
          .outage = ocean.network.outage,
          .settling = settling(ocean),
          .method = method(sight.method),
          .stiffness = sight.stiffness,
          .device = ocean.device};
}

struct Perceived {
  double due = 0;
  double value = 0;
  double deviation = 0;  ///< Standard deviation in time.
  bool right = false;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Perceived, due, value, deviation, right)

/// How late a wall is felt beyond what the hand moves in a tick, mm.
Perceived late_wall(const Ocean& ocean, const Sight& sight, std::uint64_t seed) {
  const double tick = ocean.speed / server::ServoOptions{}.rate;
  const double error = wall_error(ocean.speed, corner_conditions(ocean, sight), seed);
  const double late = 1e3 * std::max(0.0, error - tick);
  return {.value = late, .right = late <= 0.1};
}

/// The largest force in entries that touch nothing, N.
Perceived ghost_force(const Ocean& ocean, const Sight& sight, std::uint64_t seed) {
  Perceived worst;
  bool right = true;
  bool tried = false;
  for (const Walls walls : {Walls::kTestbed, Walls::kMesh}) {
    for (const bool wanders : {false, true}) {
      const Entry entry{.clearance = 0.001,
                        .speed = ocean.speed,
                        .wanders = wanders,
                        .seed = seed,
                        .walls = walls};
      if (least_gap(entry, {}) < kTouchesNothing) continue;
      const EntryOutcome outcome = enter(entry, corner_conditions(ocean, sight));
      worst.value = std::max(worst.value, outcome.largest_force);
      right = right && outcome.enters && outcome.largest_force <= kGhostForce;
      tried = true;
    }
  }
  worst.right = tried && right;
  return worst;
}

/// A task with its force, between two times.
struct Handling {
  BodyTask task;
  Vector3 axis;  ///< Of the force on the hand.
  double due;    ///< N.
  double other;  ///< N: of the tool's own weight, in the same direction.
  double begin;  ///< s.
  double end;
  bool still;  ///< The force shall not change.
};

/// Until the hand begins, s: at a moment of a frame that is drawn.
double waiting(const Ocean& ocean, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  return 5 * ocean.round_trip + settling(ocean) + uniform(engine, 0, 1 / ocean.rate);
}

BodyConditions body_conditions(const Ocean& ocean, const char* name, double stiffness,
                               double matters) {
  BodyConditions conditions{.ve_rate = ocean.rate,
                            .delay = ocean.round_trip / 2,
                            .loss = ocean.network.loss,
                            .stiffness = stiffness,
                            .method = method(name),
                            .device = ocean.device};
  if (ocean.network.outage > 0) {
    const double duration = ocean.network.outage;
    conditions.outage = {matters - conditions.delay - duration / 2, duration};
  }
  return conditions;
}

Perceived handling_force(const Handling& steady, const Ocean& ocean, const Sight& sight,
                         std::uint64_t seed) {
  const double waits = waiting(ocean, seed);
  const double middle = waits + (steady.begin + steady.end) / 2;
  const ForceStatistics force =
      force_along(run(later(steady.task, waits),
                      body_conditions(ocean, sight.method, sight.stiffness, middle), seed),
                  steady.axis, waits + steady.begin, waits + steady.end);
  const double mean = force.mean - steady.other;
  const bool is_steady = !steady.still || force.deviation <= std::max(0.05, 0.06 * steady.due);
  return {.due = steady.due,
          .value = mean,
          .deviation = force.deviation,
          .right = std::abs(mean / steady.due - 1) <= 0.1 && is_steady};
}

Perceived lifted_weight(const Ocean& ocean, const Sight& sight, std::uint64_t seed) {
  constexpr double kMass = 0.3;  // kg
  return handling_force({.task = lift(kMass),
                         .axis = -Vector3::UnitZ(),
                         .due = kMass * kGravity,
                         .other = 0.5 * kGravity,
                         .begin = 3,
                         .end = 4.5,
                         .still = true},
                        ocean, sight, seed);
}

/// Over the middle of the push: there what the brick's inertia adds it also takes.
Perceived sliding_force(const Ocean& ocean, const Sight& sight, std::uint64_t seed) {
  Brick brick;
  brick.stroke = std::clamp(ocean.speed, 0.15, 0.7);  // m
  brick.duration = duration_of(brick.stroke, ocean.speed);
  const double starts = 0.5;  // s
  return handling_force({.task = slide(brick),
                         .axis = -Vector3::UnitX(),
                         .due = brick.friction * brick.mass * kGravity,
                         .other = 0,
                         .begin = starts + 0.3 * brick.duration,
                         .end = starts + 0.7 * brick.duration,
                         .still = false},
                        ocean, sight, seed);
}

/// What is felt of a door, about its hinge, N·m·s; `end`: s.
double felt_at_hinge(const std::vector<BodySample>& samples, double end) {
  double felt = 0;
  for (const BodySample& sample : samples) {
    if (sample.time > end) break;
    const Vector3 torque = sample.F_env.tail<3>() + sample.X_WP.p.cross(sample.F_env.head<3>());
    felt -= 1e-3 * torque.z();
  }
  return felt;
}

/// The angular impulse of a door that is pushed open, and what it is without delay, N·m·s.
Perceived opened_door(const Ocean& ocean, const Sight& sight, std::uint64_t seed) {
  const BodyTask task = open_door(0.17, ocean.speed);
  const double meets = 0.5 + duration_of(kDoorStroke, ocean.speed) / 2;  // s
  const auto opened = [&](const Ocean& over, const char* name) {
    const double waits = waiting(over, seed);
    const BodyTask late = later(task, waits);
    const auto conditions = body_conditions(over, name, sight.stiffness, waits + meets);
    return felt_at_hinge(run(late, conditions, seed), late.duration);
  };
  const double due = opened({.round_trip = 0, .rate = 480}, sight.due);
  const double felt = opened(ocean, sight.method);
  return {.due = due, .value = felt, .right = std::abs(felt / due - 1) <= 0.1};
}

struct Sense {
  const char* name;
  const char* unit;
  Perceived (*perceive)(const Ocean&, const Sight&, std::uint64_t);
  bool of_body;
  double slowest;  ///< Of the hand, m/s.
  double fastest;
  const char* right;
};
constexpr std::array kSenses{
    Sense{"wall", "mm", late_wall, false, 0, 1, "felt no later than v·h + 0.1 mm beyond the wall"},
    Sense{"hole", "N", ghost_force, false, 0, 1,
          "a peg that touches nothing meets no more than 0.5 N, and gets in"},
    // The body is at rest when its weight is felt.
    Sense{"weight", "N", lifted_weight, true, 0.3, 0.3, "mean within 10 % of m g, sd at most 6 %"},
    Sense{"push", "N", sliding_force, true, 0, 1, "mean within 10 % of μ m g"},
    Sense{"door", "N·m·s", opened_door, true, 0, 1,
          "angular impulse within 10 % of that without delay"}};

bool applies(const Sense& sense, const Sight& sight, const Ocean& ocean) {
  return (sight.bodies || !sense.of_body) && ocean.speed >= sense.slowest &&
         ocean.speed <= sense.fastest;
}

struct Crossing {
  const Sense* sense;
  const Sight* sight;
  Ocean ocean;
  std::uint64_t seed;
};

Inputs inputs_of(const Crossing& c) {
  return {{"method", c.sight->method},
          {"sense", c.sense->name},
          {"round_trip_s", c.ocean.round_trip},
          {"rate_hz", c.ocean.rate},
          {"speed_m_s", c.ocean.speed},
          {"network", c.ocean.network.name},
          {"seed", c.seed}};
}

std::vector<Crossing> crossings(const Bench& bench) {
  std::vector<Crossing> all;
  for (const Sense& sense : kSenses) {
    for (const Sight& sight : kSights) {
      if (bench.methods({sight.method}).empty()) continue;
      for (const Ocean& ocean : oceans(bench)) {
        if (!applies(sense, sight, ocean)) continue;
        for (const std::uint64_t seed : bench.seed_list(1)) {
          all.push_back({&sense, &sight, ocean, seed});
        }
      }
    }
  }
  return all;
}

struct Row {
  Crossing crossing;
  Perceived perceived;
};

/// What shall be right, and over which oceans.
struct Promise {
  const char* sense;
  const char* sight;
  double round_trip;  ///< The longest, s.
  double rate;        ///< The lowest, Hz.
  double speed;       ///< The highest, m/s.
  bool loss;          ///< Also with 5 % lost.
  bool outage;        ///< Also over 300 ms in which all is lost.
};
// With shapes all is right everywhere. For the others: as far as it is right.
constexpr std::array kPromises{Promise{"wall", "shapes", 1, 15, 1, true, true},
                               Promise{"hole", "shapes", 1, 15, 1, true, true},
                               Promise{"weight", "shapes", 1, 15, 1, true, true},
                               Promise{"push", "shapes", 1, 15, 1, true, true},
                               Promise{"door", "shapes", 1, 15, 1, true, true},
                               Promise{"weight", "planes", 0.2, 60, 1, false, false},
                               Promise{"push", "planes", 0.5, 15, 0.3, false, false},
                               Promise{"door", "planes", 0.05, 60, 0.3, false, false}};

bool covers(const Promise& promise, const Ocean& ocean) {
  return ocean.round_trip <= promise.round_trip && ocean.rate >= promise.rate &&
         ocean.speed <= promise.speed && (promise.loss || ocean.network.loss == 0) &&
         (promise.outage || ocean.network.outage == 0);
}

std::string words(const Promise& promise) {
  return fmt::format("{}, {}: 0 to {:.0f} ms there and back, {:.0f} to 200 Hz, to {} m/s{}{}",
                     promise.sense, promise.sight, 1e3 * promise.round_trip, promise.rate,
                     promise.speed, promise.loss ? ", 5 % lost" : "",
                     promise.outage ? ", an outage of 300 ms" : "");
}

bool is(const Crossing& crossing, std::string_view sense, std::string_view sight) {
  return crossing.sense->name == sense && crossing.sight->name == sight;
}

void claim(Bench& bench, const Promise& promise, const std::vector<Row>& rows) {
  int count = 0;
  int right = 0;
  double off = 0;
  const Sense* sense = nullptr;
  for (const auto& [crossing, perceived] : rows) {
    if (!is(crossing, promise.sense, promise.sight) || !covers(promise, crossing.ocean)) continue;
    sense = crossing.sense;
    ++count;
    right += perceived.right;
    const double difference = std::abs(perceived.value - perceived.due);
    if (!(difference <= off)) off = difference;
  }
  if (count == 0) return;
  bench.claim(
      {.what = words(promise),
       .criterion = sense->right,
       .measured = fmt::format("{} of {}, at worst {:.2g} {} off", right, count, off, sense->unit),
       .holds = right == count});
}

/// The longest round trip up to which all is right, in words.
std::string edge(const Sense& sense, const Sight& sight, const std::vector<Row>& rows) {
  const Ocean middle;
  double longest = -1;
  for (const auto& [crossing, perceived] : rows) {
    const Ocean& ocean = crossing.ocean;
    if (!is(crossing, sense.name, sight.name) || ocean.rate != middle.rate ||
        ocean.speed != middle.speed || ocean.network.name != middle.network.name) {
      continue;
    }
    if (!perceived.right) break;
    longest = ocean.round_trip;
  }
  return longest < 0 ? fmt::format("{} at none", sight.name)
                     : fmt::format("{} {:.0f} ms", sight.name, 1e3 * longest);
}

void find_edges(Bench& bench, const std::vector<Row>& rows) {
  for (const Sense& sense : kSenses) {
    std::string edges;
    for (const Sight& sight : kSights) {
      const bool there = std::ranges::any_of(
          rows, [&](const Row& row) { return is(row.crossing, sense.name, sight.name); });
      if (there) edges += (edges.empty() ? "" : ", ") + edge(sense, sight, rows);
    }
    if (edges.empty()) continue;
    bench.find(fmt::format("{} ({}): right at 60 Hz and 0.3 m/s to a round trip of: {}. Seed {}.",
                           sense.name, sense.right, edges, bench.seed()));
  }
}

/// Through which outages a body stays that is held.
void find_longest_outage(Bench& bench) {
  const std::vector<double> durations{0.01, 0.02, 0.05, 0.1, 0.2, 0.3};  // s
  Table& table = bench.table("ocean_outages", "sight,outage_s,value,deviation,right");
  std::string longest;
  for (const Sight& sight : kSights) {
    if (!sight.bodies || bench.methods({sight.method}).empty()) continue;
    const auto inputs = [&](double duration) {
      return Inputs{{"method", sight.method}, {"sense", "weight"}, {"outage_s", duration}};
    };
    const auto held = bench.map(durations, inputs, [&](double duration) {
      const Network network{"outage", 0, duration};
      return lifted_weight({.network = network}, sight, bench.seed());
    });
    double through = 0;
    bool so_far = true;
    for (std::size_t i = 0; i < held.size(); ++i) {
      const Perceived& p = held[i];
      table.row(sight.name, durations[i], p.value, p.deviation, p.right ? 1.0 : 0.0);
      so_far = so_far && p.right;
      if (so_far) through = durations[i];
    }
    longest +=
        fmt::format("{}{} {:.0f} ms", longest.empty() ? "" : ", ", sight.name, 1e3 * through);
  }
  bench.find("weight: right at 60 Hz and a round trip of 200 ms through outages of up to: " +
             longest + ".");
}

/// What the user may give values to.
struct WantedOcean {
  Ocean ocean;
  double delay = Ocean{}.round_trip / 2;  ///< One way, s.
  double stiffness = 0;                   ///< N/m; 0: as kSights has it.
};

void declare_wanted_ocean(settings::Table& table, WantedOcean& wanted) {
  table.number("delay", wanted.delay, {0, 10, "s"}, "Of the network, one way");
  table.number("rate", wanted.ocean.rate, {1, 1000, "Hz"}, "Of the engine");
  table.number("speed", wanted.ocean.speed, {0.01, 1, "m/s"}, "Of the hand");
  table.number("loss", wanted.ocean.network.loss, {0, 0.9, ""}, "Share of datagrams");
  table.number("outage", wanted.ocean.network.outage, {0, 2, "s"}, "When it matters most");
  table.number("stiffness", wanted.stiffness, {1, 1e7, "N/m"}, "Of contacts or of the coupling");
  table.file("device", wanted.ocean.device, "Keys of a simulated device, TOML");
}

/// The senses with the user's values.
void ocean_over(Bench& bench) {
  std::vector<SweptCell> cells;
  const auto variants = bench.over().variants(WantedOcean{}, declare_wanted_ocean);
  for (const Sense& sense : kSenses) {
    for (Sight sight : kSights) {
      if (bench.methods({sight.method}).empty()) continue;
      for (const auto& [wanted, given] : variants) {
        Ocean ocean = wanted.ocean;
        ocean.round_trip = 2 * wanted.delay;
        if (wanted.stiffness > 0) sight.stiffness = wanted.stiffness;
        if (sense.of_body && !sight.bodies) continue;
        for (const std::uint64_t seed : bench.seeds_of_variant()) {
          cells.push_back({sight.method, Inputs{{"sense", sense.name}} + given, seed,
                           [&sense, sight, ocean, seed] {
                             const Perceived p = sense.perceive(ocean, sight, seed);
                             return std::vector<Swept>{{.what = sense.name,
                                                        .unit = sense.unit,
                                                        .criterion = sense.right,
                                                        .value = p.value,
                                                        .due = p.due,
                                                        .deviation = p.deviation,
                                                        .right = p.right}};
                           }});
        }
      }
    }
  }
  sweep_over(bench, "ocean", cells);
}

}  // namespace

void ocean(Bench& bench) {
  if (bench.over().any()) return ocean_over(bench);
  const std::vector<Crossing> all = crossings(bench);
  const std::vector<Perceived> outcomes = bench.map(
      all, [](const Crossing& c) { return inputs_of(c); },
      [](const Crossing& c) { return c.sense->perceive(c.ocean, *c.sight, c.seed); });
  Table& table =
      bench.table("ocean",
                  "sense,unit,sight,round_trip_s,rate_hz,speed_m_s,network,seed,due,value,"
                  "deviation,right");
  std::vector<Row> rows;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [sense, sight, ocean, seed] = all[i];
    const Perceived& p = outcomes[i];
    table.row(sense->name, sense->unit, sight->name, ocean.round_trip, ocean.rate, ocean.speed,
              ocean.network.name, static_cast<double>(seed), p.due, p.value, p.deviation,
              p.right ? 1.0 : 0.0);
    rows.push_back({all[i], p});
  }
  for (const Promise& promise : kPromises) claim(bench, promise, rows);
  find_edges(bench, rows);
  find_longest_outage(bench);
}

}  // namespace hlm::experiments
