// Round bodies that the tool rolls along: server and client together, in virtual time
// (docs/method.md 11).
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

using server::TickRecord;

constexpr double kRadius = 0.015;  // m, of a body, or from its axis to its edges
constexpr double kWay = 0.02;      // m, of the hand to each side

/// A table, a pad that the hand holds, and a round body between them; along x the hand rolls it.
ve::WorldDescription table_with(const std::string& geometry, double mass) {
  const auto inertial = [](double m, double moment) {
    return "<inertial><mass>" + std::to_string(m) + "</mass><inertia><ixx>" +
           std::to_string(moment) + "</ixx><iyy>" + std::to_string(moment) + "</iyy><izz>" +
           std::to_string(moment) + "</izz></inertia></inertial>";
  };
  const std::string friction = "<surface><friction><ode><mu>0.4</mu></ode></friction></surface>";
  return world_of(
      "<model name='pad'><pose>0 0 0.045 0 0 0</pose><link name='body'><gravity>false</gravity>" +
          inertial(0.3, 6e-5) + "<collision name='box'><geometry><box><size>0.08 0.06 0.02</size>" +
          "</box></geometry>" + friction + "</collision></link></model>" +
          "<model name='round'><pose>0 0 0.015 1.57079632679 0 0</pose><link name='body'>" +
          inertial(mass, 0.5 * mass * kRadius * kRadius) + "<collision name='shape'><geometry>" +
          geometry + "</geometry>" + friction + "</collision></link></model>" +
          "<model name='table'><static>true</static><link name='top'><collision name='plane'>"
          "<geometry><plane><normal>0 0 1</normal></plane></geometry>" +
          friction + "</collision></link></model>",
      "0 0 -9.81");
}

server::HandScript roll() {
  server::Grip grip;
  grip.stiffness = 400;        // N/m
  grip.damping = 30;           // N·s/m
  grip.angular_stiffness = 3;  // N·m/rad
  server::HandScript script;
  const auto reach = [&](double duration, double x) {
    server::Reach to;
    to.grip = grip;
    to.position = Vector3(x, 0, 0.033);  // 7 mm into the body
    to.rotation = Vector3::Zero().eval();
    script.segments.push_back({duration, to});
  };
  reach(1, 0);
  reach(1, kWay);
  reach(2, -kWay);
  reach(2, kWay);
  script.after = server::AfterLastSegment::kHold;
  return script;
}

TEST_CASE("A round body rolls half as far as the pad on it, and presses evenly") {
  const auto [name, geometry] = GENERATE(table<std::string, std::string>(
      {{"cylinder", "<cylinder><radius>0.015</radius><length>0.035</length></cylinder>"},
       {"capsule", "<capsule><radius>0.015</radius><length>0.03</length></capsule>"},
       {"ball", "<sphere><radius>0.015</radius></sphere>"}}));
  const double mass = GENERATE(0.1, 0.3);    // kg
  const double delay = GENERATE(0.0, 0.02);  // s each way
  CAPTURE(name, mass, delay);
  VirtualSessionOptions options;
  options.world = table_with(geometry, mass);
  options.tool = "pad";
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.hand = roll();
  options.link = {.delay = delay};
  double least = 1e9, most = 0, largest_error = 0, fastest = 0;
  VirtualSession* running = nullptr;
  VirtualSession session(options, [&](const TickRecord& tick) {
    if (running->now() < 1) return;
    const ve::World& world = running->environment().world;
    const double f = tick.F_env.z();
    least = std::min(least, f);
    most = std::max(most, f);
    const double rolled = world.X_WB(1).p.x();
    largest_error = std::max(largest_error, std::abs(rolled - 0.5 * tick.X_WT.p.x()));
    fastest = std::max(fastest, world.V_WB(1).tail<3>().norm());
  });
  running = &session;
  session.run(6.5);
  CHECK(least > 2.0);            // N, never lost
  CHECK(most < 3.2);             // N
  CHECK(largest_error < 0.002);  // m
  CHECK(fastest < 2);            // rad/s: the hand's 0.04 m/s
}

/// A rod with eight sides, on one of which it lies.
void write_octagonal_rod(const std::filesystem::path& path) {
  std::ofstream file(path);
  for (const double z : {-0.0175, 0.0175}) {
    for (int i = 0; i < 8; ++i) {
      const double angle = std::numbers::pi * (2 * i + 1) / 8;
      file << "v " << kRadius * std::cos(angle) << ' ' << kRadius * std::sin(angle) << ' ' << z
           << '\n';
    }
  }
  for (int i = 1; i <= 8; ++i) {
    const int next = i % 8 + 1;
    file << "f " << i << ' ' << next << ' ' << next + 8 << ' ' << i + 8 << '\n';
  }
  file << "f 8 7 6 5 4 3 2 1\nf 9 10 11 12 13 14 15 16\n";
}

TEST_CASE("A rod with edges under a flat pad is not thrown out: its edges meet the pad's plane") {
  const double mass = GENERATE(0.1, 0.3);          // kg
  const double rate = GENERATE(30.0, 45.0, 60.0);  // Hz
  CAPTURE(mass, rate);
  const TemporaryDirectory directory;
  write_octagonal_rod(directory.file("rod.obj"));
  VirtualSessionOptions options;
  options.world = table_with("<mesh><uri>" + directory.file("rod.obj") + "</uri></mesh>", mass);
  options.frame.shapes = false;
  options.tool = "pad";
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.hand = roll();
  options.link = {.delay = 0.02};  // s each way
  options.rate_low = options.rate_high = rate;
  double least = 1e9, most = 0, fastest = 0;
  VirtualSession* running = nullptr;
  VirtualSession session(options, [&](const TickRecord& tick) {
    if (running->now() < 1) return;
    least = std::min(least, tick.F_env.z());
    most = std::max(most, tick.F_env.z());
    fastest = std::max(fastest, running->environment().world.V_WB(1).tail<3>().norm());
  });
  running = &session;
  session.run(6.5);
  CHECK(least > 1.0);    // N, never lost
  CHECK(most < 4.0);     // N
  CHECK(fastest < 1.5);  // rad/s; thrown out it turns at 35 and more
}

}  // namespace
}  // namespace hlm::test
