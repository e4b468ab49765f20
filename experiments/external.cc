// External wrenches (docs/method.md 19): an environment states what pushes the tool, and the hand
// feels a load as a load, drag as drag and a wall as a wall.
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace wrenches {
namespace {

constexpr double kWeight = 9.81;        // N/kg
constexpr double kToolMass = 0.3;       // kg
constexpr double kSubstep = 0.002;      // s: of the environment
constexpr double kHandStiffness = 200;  // N/m

/// An environment's own, which answers a tool that it moves as it is told: the wrench on the tool
/// at its origin at the end of a step.
using Load = std::function<Wrench(const Pose& X_WT, const Twist& V_W, double step)>;

Load constant(const Vector3& F) {
  return [F](const Pose&, const Twist&, double) { return test::force(F.x(), F.y(), F.z()); };
}

/// z <= 0.
Load wall(double stiffness) {
  return [stiffness](const Pose& X_WT, const Twist&, double) {
    return test::force(0, 0, stiffness * std::max(0.0, -X_WT.p.z()));
  };
}

Load drag(double damping) {
  return [damping](const Pose&, const Twist& V_W, double) {
    Wrench F = Wrench::Zero();
    F.head<3>() = -damping * V_W.head<3>();
    return F;
  };
}

/// Coulomb's, that holds below 10 mm/s.
Vector3 friction(const Twist& V_W, double force) {
  const Vector3 v = V_W.head<3>();
  return -force / std::max(v.norm(), 0.01) * v;
}

Load dry_friction(double force) {
  return [force](const Pose&, const Twist& V_W, double) {
    const Vector3 F = friction(V_W, force);
    return test::force(F.x(), F.y(), F.z());
  };
}

/// wall() that is rough.
Load rough_wall(double stiffness, double mu) {
  return [stiffness, mu](const Pose& X_WT, const Twist& V_W, double) {
    const double load = stiffness * std::max(0.0, -X_WT.p.z());
    Twist along = V_W;
    along[2] = 0;
    const Vector3 F = friction(along, mu * load);
    return test::force(F.x(), F.y(), load);
  };
}

/// A sensor's noise of that standard deviation on each axis, N.
Load noise(double deviation) {
  return [deviation, random = std::mt19937_64(1)](const Pose&, const Twist&, double) mutable {
    std::normal_distribution<double> normal(0, deviation);
    const double x = normal(random);
    const double y = normal(random);
    return test::force(x, y, normal(random));
  };
}

/// A point mass that is welded to the tool as MuJoCo does it, with a time constant of 20 ms.
Load payload(double mass) {
  struct State {
    bool begun = false;
    Vector3 p = Vector3::Zero();
    Vector3 v = Vector3::Zero();
  };
  return [mass, state = State{}](const Pose& X_WT, const Twist& V_W, double step) mutable {
    constexpr double kTime = 0.02;
    const double k = mass / (kTime * kTime);
    const double b = 2 * mass / kTime;
    if (!state.begun) state = {true, X_WT.p, V_W.head<3>()};
    const Vector3 F =
        k * (X_WT.p - state.p) + b * V_W.head<3>() - mass * kWeight * Vector3::UnitZ();
    state.v = (state.v + step / mass * F) / (1 + step / mass * (b + step * k));
    state.p += step * state.v;
    const Vector3 on_tool = -k * (X_WT.p - state.p) - b * (V_W.head<3>() - state.v);
    return test::force(on_tool.x(), on_tool.y(), on_tool.z());
  };
}

Load both(Load a, Load b) {
  return [a = std::move(a), b = std::move(b)](const Pose& X, const Twist& V, double step) mutable {
    const Wrench F = a(X, V, step);
    return Wrench(F + b(X, V, step));
  };
}

struct Conditions {
  double ve_rate = 60;         ///< Hz.
  double delay = 0;            ///< One way, s.
  double loss = 0;             ///< Share of datagrams.
  bool measures_hand = false;  ///< The device does.
};

struct Task {
  std::string name;
  std::function<Load()> load;
  server::HandScript hand;
  double begin = 2;  ///< s: from here to the end it is looked at.
  double end = 5;    ///< s.
};

struct Sample {
  double time = 0;
  Vector3 F_command = Vector3::Zero();
  Vector3 p_WP = Vector3::Zero();
  Vector3 p_WD = Vector3::Zero();
};

ToolDescription tool() {
  ToolDescription tool;
  Link link;
  link.joint = JointType::kFree;
  link.mass = kToolMass;
  link.I_LCom = 8e-5 * Matrix3::Identity();
  tool.links.push_back(link);
  tool.length = 0.04;
  return tool;
}

std::vector<Sample> run(const Task& task, const Conditions& conditions, std::uint64_t seed) {
  test::VirtualSessionOptions options;
  options.hand = task.hand;
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.mass = 0.2;
  options.device.dry_friction = 0;
  options.device.measures_hand_wrench = conditions.measures_hand;
  options.device.max_force = 12;
  options.link = {.delay = conditions.delay, .loss = conditions.loss};
  options.seed = seed;
  test::VirtualServer server(options, task.hand, seed);
  Configuration q(7);
  q << 0, 0, 0.002, 1, 0, 0, 0;
  HapticClient client(server.network().client(), {.server = protocol::MemoryNetwork::kServer,
                                                  .tool = tool(),
                                                  .q = q,
                                                  .ve_rate = conditions.ve_rate,
                                                  .nonce = 1});
  Load load = task.load();
  std::vector<Sample> samples;
  const double period = 1 / conditions.ve_rate;
  const auto substeps = static_cast<int>(std::ceil(period / kSubstep - 1e-9));
  Velocity v = Velocity::Zero(6);
  ToolModel model(tool());
  test::VirtualClock clock([&](double now) {
    const server::TickRecord* record = server.tick(now);
    if (record == nullptr || record->step == 0) return;
    samples.push_back({.time = 1e-3 * static_cast<double>(record->step),
                       .F_command = record->F_command.head<3>(),
                       .p_WP = record->X_WP.p,
                       .p_WD = record->X_WD.p});
  });
  while (samples.empty() || samples.back().time < task.end) {
    if (clock.now() > task.end + 2) break;
    if (const protocol::ProxyState* proxy = client.poll(clock.now()).state) {
      q = proxy->q;
      v = proxy->v;
    }
    Wrench F = Wrench::Zero();
    for (int i = 0; i < substeps; ++i) {
      q = model.integrate(q, v, period / substeps);
      model.set_configuration(q);
      F = load(model.X_WL(0), v, period / substeps);
    }
    client.sample(clock.now(), q, v, period);
    client.add_external(0, F);
    client.send(clock.now(), {});
    clock.sleep_until(clock.now() + period);
  }
  return samples;
}

server::HandScript holds(const Vector3& at) {
  server::Reach reach;
  reach.position = at;
  reach.grip.stiffness = kHandStiffness;
  reach.grip.damping = 5;
  reach.grip.max_force = 12;
  return {{{1.0, reach}}, server::AfterLastSegment::kHold};
}

/// To and fro between two places.
server::HandScript shuttles(const Vector3& a, const Vector3& b, double time) {
  server::HandScript hand = holds(a);
  hand.segments[0].duration = time;
  hand.segments.push_back(holds(b).segments[0]);
  hand.segments[1].duration = time;
  hand.after = server::AfterLastSegment::kRepeat;
  return hand;
}

struct Outcome {
  bool whole = false;
  double mean = std::numeric_limits<double>::quiet_NaN();  ///< Force on the hand along z, N.
  double deviation = 0;
  double largest = 0;  ///< |F| along z, N.
  double smallest = 0;
  double step = 0;   ///< Largest change from tick to tick, N.
  double least = 0;  ///< Of the proxy along z, m.
  double most = 0;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Outcome, whole, mean, deviation, largest, smallest, step, least,
                                   most)

Outcome play(const Task& task, const Conditions& conditions, std::uint64_t seed) {
  const std::vector<Sample> samples = run(task, conditions, seed);
  Outcome outcome;
  outcome.whole = !samples.empty() && samples.back().time >= task.end;
  double sum = 0;
  double squares = 0;
  int count = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].time < task.begin) continue;
    const double f = samples[i].F_command.z();
    const double z = samples[i].p_WP.z();
    outcome.largest = std::max(outcome.largest, std::abs(f));
    outcome.smallest = count == 0 ? std::abs(f) : std::min(outcome.smallest, std::abs(f));
    outcome.least = count == 0 ? z : std::min(outcome.least, z);
    outcome.most = count == 0 ? z : std::max(outcome.most, z);
    outcome.step = std::max(outcome.step, (samples[i].F_command - samples[i - 1].F_command).norm());
    sum += f;
    squares += f * f;
    ++count;
  }
  if (!outcome.whole || count == 0) return outcome;
  outcome.mean = sum / count;
  outcome.deviation = std::sqrt(std::max(0.0, squares / count - outcome.mean * outcome.mean));
  return outcome;
}

std::vector<Conditions> grid(const Bench& bench) {
  std::vector<Conditions> all;
  for (const bool measures : {false, true}) {
    for (const double rate : {30.0, 60.0, 240.0}) {
      for (const double delay : {0.0, 0.02, 0.05}) {
        if (bench.quick() && (rate != 60 || measures)) continue;
        all.push_back({.ve_rate = rate, .delay = delay, .measures_hand = measures});
      }
    }
  }
  return all;
}

/// Where the hand holds still: a load with what it weighs, a wall with what the hand's spring,
/// which ends behind it, draws with.
struct Steady {
  Task task;
  double due = 0;  ///< N.
};

std::vector<Outcome> play_all(Bench& bench, Table& table, const Task& task, double due) {
  const auto conditions = grid(bench);
  const auto outcomes = bench.map(
      conditions,
      [&](const Conditions& c) {
        return Inputs{{"task", task.name},
                      {"hand", c.measures_hand ? "measured" : "unknown"},
                      {"ve_rate_Hz", c.ve_rate},
                      {"delay_s", c.delay}};
      },
      [&](const Conditions& c) { return play(task, c, bench.seed()); });
  std::vector<Outcome> near;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& o = outcomes[i];
    const Conditions& c = conditions[i];
    table.row(task.name, c.measures_hand ? "measured" : "unknown", c.ve_rate, c.delay, due, o.mean,
              o.deviation, o.step, o.least, o.most, o.smallest, o.largest);
    if (c.delay <= 0.02) near.push_back(o);
  }
  return near;
}

void steady(Bench& bench, Table& table) {
  const Vector3 z = Vector3::UnitZ();
  const Vector3 behind = -0.02 * z;
  const auto pressed = [&](double k) { return 0.02 * kHandStiffness * k / (kHandStiffness + k); };
  const std::vector<Steady> all{
      {{"constant 3 N",
        [] {
          return constant({0, 0, -3});
        },
        holds(0.05 * z)},
       -3},
      {{"0.3 kg", [] { return payload(0.3); }, holds(0.05 * z)}, -0.3 * kWeight},
      {{"1 kg", [] { return payload(1); }, holds(0.05 * z)}, -kWeight},
      {{"wall 4 kN/m", [] { return wall(4e3); }, holds(behind)}, pressed(4e3)},
      {{"wall 20 kN/m", [] { return wall(2e4); }, holds(behind)}, pressed(2e4)},
      {{"wall 20 kN/m and 0.3 kg", [] { return both(wall(2e4), payload(0.3)); }, holds(behind)},
       pressed(2e4) * (1 - 0.3 * kWeight / (2e4 * 0.02))},
  };
  double off = 0;
  double deviation = 0;
  double step = 0;
  for (const Steady& each : all) {
    for (const Outcome& o : play_all(bench, table, each.task, each.due)) {
      const double error = std::abs(o.mean - each.due);
      off = error <= off ? off : error;
      deviation = std::max(deviation, o.deviation);
      step = std::max(step, o.step);
    }
  }
  bench.claim(
      {.what = "External wrenches, steady",
       .criterion = "3 N, a payload of 0.3 and 1 kg on a tool of 0.3 kg, walls of 4 and 20 "
                    "kN/m and a wall with a payload are felt within 0.05 N, sd at most "
                    "0.05 N, no step of more than 0.05 N, at 30, 60 and 240 Hz, 0 and 20 "
                    "ms each way, the hand's wrench known or not",
       .measured = fmt::format("{:.2g} N off at most, sd up to {:.2g} N, steps up to {:.2g} N", off,
                               deviation, step),
       .holds = off <= 0.05 && deviation <= 0.05 && step <= 0.05});
}

void moved(Bench& bench, Table& table) {
  const auto lifted = shuttles({0, 0, 0.02}, {0, 0, 0.12}, 0.5);
  double off = 0;
  double step = 0;
  const auto follow = [&](const std::string& name, std::function<Load()> load, double due) {
    for (const Outcome& o : play_all(bench, table, {name, std::move(load), lifted, 3, 7}, due)) {
      const double error = std::abs(o.mean - due);
      off = error <= off ? off : error;
      step = std::max(step, o.step);
    }
  };
  follow(
      "0.3 kg moved", [] { return payload(0.3); }, -0.3 * kWeight);
  follow(
      "drag 5 N.s/m", [] { return drag(5); }, 0);
  follow(
      "drag 50 N.s/m", [] { return drag(50); }, 0);
  bench.claim({.what = "External wrenches, moved",
               .criterion =
                   "a payload of 0.3 kg, drag of 5 and 50 N.s/m that the hand moves to and "
                   "fro by 0.1 m in 1 s: on average what they weigh within 0.1 N, no step "
                   "of more than 0.1 N, in the same conditions",
               .measured = fmt::format("{:.2g} N off at most, steps up to {:.2g} N", off, step),
               .holds = off <= 0.1 && step <= 0.1});
  // What has nothing to do with where the tool is, and with a wall that is rough.
  play_all(bench, table, {"friction 2 N", [] { return dry_friction(2); }, lifted, 3, 7}, 0);
  double heard = 0;
  for (const Outcome& o :
       play_all(bench, table, {"noise 0.2 N", [] { return noise(0.2); }, lifted, 3, 7}, 0)) {
    heard = std::max(heard, o.deviation);
  }
  bench.claim({.what = "External wrenches, noise",
               .criterion =
                   "of a sensor's noise of 0.2 N a hand that moves feels at most 0.6 N, as a "
                   "standard deviation with its own acceleration, in the same conditions",
               .measured = fmt::format("{:.2g} N", heard),
               .holds = heard <= 0.6});
  const auto slid = shuttles({-0.05, 0, -0.02}, {0.05, 0, -0.02}, 0.5);
  play_all(bench, table, {"wall 20 kN/m, slid", [] { return wall(2e4); }, slid, 3, 7}, 0);
  play_all(bench, table, {"wall 20 kN/m, mu 0.3", [] { return rough_wall(2e4, 0.3); }, slid, 3, 7},
           0);
  play_all(bench, table, {"wall 4 kN/m, mu 0.3", [] { return rough_wall(4e3, 0.3); }, slid, 3, 7},
           0);
  const auto taps = shuttles({0, 0, 0.02}, {0, 0, -0.02}, 0.6);
  play_all(bench, table, {"wall 20 kN/m, taps", [] { return wall(2e4); }, taps, 3, 7}, 0);
}

}  // namespace
}  // namespace wrenches

void external(Bench& bench) {
  Table& table = bench.table(
      "external",
      "task,hand,ve_rate_Hz,delay_s,due_N,mean_N,sd_N,step_N,least_m,most_m,smallest_N,largest_N");
  wrenches::steady(bench, table);
  wrenches::moved(bench, table);
}

}  // namespace hlm::experiments
