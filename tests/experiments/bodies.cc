// Bodies that move when pushed: action equals reaction (docs/method.md 9).
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
  task.world = test::world_of(
      fixed("rails", collision("left", rail, {-0.02, 0, -0.01}, 0.4) +
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

void print(const char* name, const BodyConditions& c, const ForceStatistics& f, double due,
           const std::string& more = "") {
  fmt::print(
      "{:<10} {:2.0f} Hz {:3.0f} ms k {:6.0f}{}: {:.4f} of {:.4f} N ({:.3f}) sd {:.4f} largest "
      "{:.2f} update step {:.3f} any step {:.3f} collisions {} {}\n",
      name, c.ve_rate, 1e3 * c.delay, c.stiffness, c.by_following ? " old" : "", f.mean, due,
      f.mean / due, f.deviation, f.largest, f.update_step, f.step, f.collisions, more);
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

}  // namespace

void bodies(Bench& bench) {
  for (const double mass : {0.3, 1.0, 3.0}) {
    for (const BodyConditions& c : grid(bench)) {
      const auto samples = run(lift(mass), c, 1);
      const auto f = force_along(samples, -Vector3::UnitZ(), 3, 5);
      ForceStatistics net = f;
      net.mean -= 0.5 * kGravity;
      print(fmt::format("lift {}", mass).c_str(), c, net, mass * kGravity,
            fmt::format("body at {:.4f} tool {:.4f}", samples.back().X_WB.p.z(),
                        samples.back().X_WP.p.z()));
    }
  }
  for (const double off : {0.0, 0.02}) {
    for (const BodyConditions& c : grid(bench)) {
      const auto samples = run(push(0.4, move({0.3, 0, 0}, 4), off), c, 1);
      const auto f = force_along(samples, -Vector3::UnitX(), 1.5, 3.5);
      print(off > 0 ? "slide off" : "slide", c, f, 0.4 * 0.375 * kGravity,
            fmt::format("body at {:.4f}", samples.back().X_WB.p.x()));
    }
  }
  for (const BodyConditions& c : grid(bench)) {
    const auto samples =
        run(push(0.4, force({3, 0, 0}, 4), 0,
                 collision("post", {0.02, 0.2, 0.1}, {0.062, 0, 0.05}, 0.4)),
            c, 1);
    print("jam", c, force_along(samples, -Vector3::UnitX(), 3, 5), 3);
  }
  for (const BodyConditions& c : grid(bench)) {
    BodyTask task = push(0.4, force({0, 0, -2}, 4), 0);
    task.world = test::world_of(
        fixed("table", collision("top", {2, 2, 0.1}, {0, 0, -0.05}, 0.4)) +
            body("body", 0.3, {0.1, 0.1, 0.05}, {0, 0, 0.025}, 0.4) +
            "<model name='tool'><pose>0.01 0.005 0.064 0 0 0</pose><link name='body'><gravity>false"
            "</gravity><inertial><mass>0.5</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3"
            "</izz></inertia></inertial>" +
            collision("box", {0.04, 0.04, 0.02}, Vector3::Zero(), 0.4) + "</link></model>",
        kDown);
    const auto samples = run(task, c, 1);
    print("rest", c, force_along(samples, Vector3::UnitZ(), 3, 5), 2);
  }
}

}  // namespace hlm::experiments
