// Bodies that move when pushed: action equals reaction (docs/method.md 11).
#include <algorithm>
#include <tuple>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/body_trial.h"
#include "tests/experiments/experiments.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

constexpr double kGravity = 9.81;

std::string collision(const std::string& name, const Vector3& size, const Vector3& at,
                      double friction) {
  return fmt::format(
      "<collision name='{}'><pose>{} {} {} 0 0 0</pose><geometry><box><size>{} {} {}</size></box>"
      "</geometry><surface><friction><ode><mu>{}</mu></ode></friction></surface>"
      "</collision>",
      name, at.x(), at.y(), at.z(), size.x(), size.y(), size.z(), friction);
}

std::string body(const std::string& name, double mass, const Vector3& size, const Vector3& at,
                 double friction, const std::string& more = "") {
  const auto moment = [&](int i, int j) {
    return mass / 12 * (size[i] * size[i] + size[j] * size[j]);
  };
  return fmt::format(
      "<model name='{}'><pose>{} {} {} 0 0 0</pose>{}<link name='body'><inertial><mass>{}</mass>"
      "<inertia><ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz></inertia></inertial>{}</link></model>",
      name, at.x(), at.y(), at.z(), more, mass, moment(1, 2), moment(0, 2), moment(0, 1),
      collision("box", size, Vector3::Zero(), friction));
}

std::string fixed(const std::string& name, const std::string& collisions) {
  return "<model name='" + name + "'><static>true</static><link name='body'>" + collisions +
         "</link></model>";
}

server::Grip firm() {
  return {.stiffness = 1000,
          .damping = 40,
          .angular_stiffness = 20,
          .angular_damping = 0.5,
          .max_force = 100,
          .max_torque = 5};
}

server::HandSegment move(const Vector3& way, double duration) {
  server::Reach reach;
  reach.position = way;
  reach.relative = true;
  reach.grip = firm();
  return {duration, reach};
}

server::HandSegment force(const Vector3& F, double duration) {
  server::Push push;
  push.constant.head<3>() = F;
  return {duration, push};
}

server::HandScript script(std::vector<server::HandSegment> segments) {
  return {std::move(segments), server::AfterLastSegment::kHold};
}

const std::string kDown = "0 0 -9.81";

/// A cube of 50 mm on two rails is lifted by a tray of 0.5 kg from below.
BodyTask lift(double mass) {
  const Vector3 rail(0.01, 0.1, 0.02);
  BodyTask task;
  task.world = test::world_of(fixed("rails", collision("left", rail, {-0.02, 0, -0.01}, 0.4) +
                                                 collision("right", rail, {0.02, 0, -0.01}, 0.4)) +
                                  body("body", mass, {0.05, 0.05, 0.05}, {0, 0, 0.025}, 0.4) +
                                  body("tool", 0.5, {0.026, 0.06, 0.01}, {0, 0, -0.01}, 0.4),
                              kDown);
  task.hand = script({move({0, 0, 0}, 0.4), move({0, 0, 0.05}, 1.0), move({0, 0, 0.05}, 5)});
  task.duration = 5;
  return task;
}

/// A brick of 0.375 kg on a table is pushed sideways at 50 mm/s, or by a force.
BodyTask push(double friction, const server::HandSegment& hand, double off_centre,
              const std::string& more = "") {
  BodyTask task;
  task.world = test::world_of(
      fixed("table", collision("top", {2, 2, 0.1}, {0, 0, -0.05}, friction) + more) +
          body("body", 0.375, {0.1, 0.1, 0.05}, {0, 0, 0.025}, friction) +
          "<model name='tool'><pose>-0.073 " + fmt::format("{}", off_centre) +
          " 0.025 0 0 0</pose><link name='body'><gravity>false</gravity><inertial><mass>0.5</mass>"
          "<inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia></inertial>" +
          collision("box", {0.04, 0.04, 0.02}, Vector3::Zero(), friction) + "</link></model>",
      kDown);
  task.hand = script({force({0, 0, 0}, 0.5), hand});
  task.duration = 5;
  return task;
}

/// A body of 0.3 kg floats freely; the hand throws the tool at it, off its centre, and lets go.
BodyTask hit(double off_centre) {
  BodyTask task;
  task.world = test::world_of(body("body", 0.3, {0.06, 0.06, 0.06}, {0, 0, 0}, 0.3) +
                              body("tool", 0.5, {0.03, 0.03, 0.03}, {-0.075, off_centre, 0}, 0.3));
  task.hand = {{force({0, 0, 0}, 0.5), force({4, 0, 0}, 0.12)}, server::AfterLastSegment::kRelease};
  task.duration = 1.5;
  return task;
}

/// Rests of 2 N on a box of 0.3 kg that stands loose on a table.
BodyTask rest() {
  BodyTask task = push(0.4, force({0, 0, -2}, 4), 0);
  task.world = test::world_of(
      fixed("table", collision("top", {2, 2, 0.1}, {0, 0, -0.05}, 0.4)) +
          body("body", 0.3, {0.1, 0.1, 0.05}, {0, 0, 0.025}, 0.4) +
          "<model name='tool'><pose>0.01 0.005 0.064 0 0 0</pose><link name='body'><gravity>false"
          "</gravity><inertial><mass>0.5</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3"
          "</izz></inertia></inertial>" +
          collision("box", {0.04, 0.04, 0.02}, Vector3::Zero(), 0.4) + "</link></model>",
      kDown);
  return task;
}

/// A task, what its force must be, and how steady.
struct Steady {
  std::string name;
  std::string what;
  BodyTask task;
  Vector3 axis;  ///< Of the force on the hand.
  double due;    ///< N.
  double other;  ///< N: of the tool's own weight, in the same direction.
  double begin;  ///< s.
  double end;    ///< s.
  double low;    ///< Of the mean, share of `due`.
  double high;
  double deviation;        ///< Largest standard deviation, N.
  double stiff_deviation;  ///< Likewise at 50 kN/m.
};

std::vector<Steady> steady_tasks(const Bench& bench) {
  std::vector<Steady> tasks;
  for (const double mass : {0.3, 1.0, 3.0}) {
    if (bench.quick() && mass == 1) continue;
    const double due = mass * kGravity;
    tasks.push_back({fmt::format("lift {} kg", mass), "the weight of a body that is held",
                     lift(mass), -Vector3::UnitZ(), due, 0.5 * kGravity, 3, 4.5, 0.97, 1.03,
                     0.06 * due, 0.06 * due});
  }
  const double slides = 0.4 * 0.375 * kGravity;
  for (const double off : {0.0, 0.02}) {
    tasks.push_back({off > 0 ? "slide off centre" : "slide",
                     "a brick that is pushed over a table moves at its friction",
                     push(0.4, move({0.3, 0, 0}, 4), off), -Vector3::UnitX(), slides, 0, 1.5, 3.5,
                     0.98, 1.1, 0.3, 0.6});
  }
  tasks.push_back({"jam", "a brick that is jammed against a post bears the push",
                   push(0.4, force({3, 0, 0}, 4), 0,
                        collision("post", {0.02, 0.2, 0.1}, {0.062, 0, 0.05}, 0.4)),
                   -Vector3::UnitX(), 3, 0, 3, 4.5, 0.97, 1.03, 0.06, 0.06});
  tasks.push_back({"rest", "a loose box bears the push", rest(), Vector3::UnitZ(), 2, 0, 3, 4.5,
                   0.97, 1.03, 0.05, 0.05});
  return tasks;
}

std::vector<BodyConditions> grid(const Bench& bench) {
  std::vector<BodyConditions> all;
  for (const double rate : {60.0, 30.0}) {
    for (const double delay : {0.0, 0.02}) {
      for (const double k : {4000.0, 16000.0, 50000.0}) {
        if (bench.quick() && k == 16000) continue;
        all.push_back({.ve_rate = rate, .delay = delay, .stiffness = k});
      }
    }
  }
  return all;
}

/// Forces that bodies must show, over the grid.
void steady_forces(Bench& bench, Table& table) {
  const std::vector<BodyConditions> conditions = grid(bench);
  for (const Steady& steady : steady_tasks(bench)) {
    const auto forces = bench.map(conditions, [&](const BodyConditions& c) {
      ForceStatistics f =
          force_along(run(steady.task, c, bench.seed()), steady.axis, steady.begin, steady.end);
      f.mean -= steady.other;
      return f;
    });
    double low = forces[0].mean;
    double high = low;
    double deviation = 0;
    double step = 0;
    int collisions = 0;
    bool steady_enough = true;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const auto& [c, f] = std::tie(conditions[i], forces[i]);
      table.row(steady.name, c.ve_rate, c.delay, c.stiffness, steady.due, f.mean, f.deviation,
                f.update_step, static_cast<double>(f.collisions));
      low = std::min(low, f.mean);
      high = std::max(high, f.mean);
      deviation = std::max(deviation, f.deviation);
      step = std::max(step, f.update_step);
      collisions += f.collisions;
      steady_enough = steady_enough && f.deviation <= (c.stiffness > 16000 ? steady.stiff_deviation
                                                                           : steady.deviation);
    }
    bench.claim(
        {.what = fmt::format("Bodies, {}", steady.name),
         .criterion = fmt::format("{}: mean {:.3g} to {:.3g} N, sd at most {:.2g} N ({:.2g} at "
                                  "50 kN/m), no collision, no step of more than 0.5 N at an "
                                  "update, at 30 and 60 Hz, 0 and 20 ms each way, "
                                  "4 to 50 kN/m",
                                  steady.what, steady.low * steady.due, steady.high * steady.due,
                                  steady.deviation, steady.stiff_deviation),
         .measured = fmt::format("{:.4g} to {:.4g} N, sd {:.2g}, {} collisions, steps at updates "
                                 "up to {:.2g} N",
                                 low, high, deviation, collisions, step),
         .holds = low >= steady.low * steady.due && high <= steady.high * steady.due &&
                  steady_enough && collisions == 0 && step <= 0.5});
  }
}

/// What a body gains is what the hand felt, with datagrams lost too.
void momentum(Bench& bench) {
  double worst = 0;
  for (BodyConditions c : grid(bench)) {
    for (const double loss : {0.0, 0.05}) {
      c.loss = loss;
      const std::vector<BodySample> samples = run(hit(0.01), c, bench.seed());
      double felt = 0;
      for (const BodySample& sample : samples) felt -= 1e-3 * sample.F_env[0];
      const double gained = 0.3 * samples.back().V_WB[0];
      worst = std::max(worst, std::abs(gained / felt - 1));
    }
  }
  bench.claim({.what = "Bodies, momentum",
               .criterion = "a free body that is hit gains what the hand felt, within 2 %, also "
                            "with 5 % of all datagrams lost",
               .measured = fmt::format("{:.2g} % off at most", 100 * worst),
               .holds = worst <= 0.02});
}

}  // namespace

void bodies(Bench& bench) {
  Table& table = bench.table(
      "bodies", "task,ve_rate_Hz,delay_s,stiffness,due_N,mean_N,sd_N,update_step_N,collisions");
  steady_forces(bench, table);
  momentum(bench);
}

}  // namespace hlm::experiments
